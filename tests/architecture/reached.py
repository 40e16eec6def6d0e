"""What nobody can use: definitions that no command, no public name and no reached definition reaches."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from architecture.tree import modules, parsed

_Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


@dataclass
class _Module:
    """A module's top-level definitions, what its names stand for, and what it runs when it is imported."""

    path: str
    is_package: bool
    definitions: dict[str, list[ast.stmt]] = field(default_factory=dict)
    bindings: dict[str, str] = field(default_factory=dict)
    runs: list[ast.AST] = field(default_factory=list)


@cache
def unreached(package: Path) -> list[str]:
    """Top-level functions, classes and constants that are reached by nothing a user can call."""
    known = {name: _module(name, path, tree) for name, path, tree in _sources(package)}
    reached: set[tuple[str, str]] = set()
    ran: set[str] = set()
    waiting = list(_roots(known))
    while waiting:
        module, name = waiting.pop()
        here = known[module]
        nodes = []
        # A module that is used is imported: what stands loose in it runs.
        if module not in ran:
            ran.add(module)
            nodes += here.runs
        if name and (module, name) not in reached:
            reached.add((module, name))
            nodes += here.definitions.get(name, [])
        for node in nodes:
            waiting += [each for each in set(_uses(node, module, known)) if each not in reached]
    return [
        f"{known[module].path}::{name}"
        for module in sorted(known)
        for name in known[module].definitions
        if (module, name) not in reached and not name.startswith("__")
    ]


def _sources(package: Path) -> Iterator[tuple[str, str, ast.Module]]:
    """The dotted name, path and tree of each module; a folder with a stub exports what the stub lists."""
    for path, tree in modules(package):
        stub = (package / path).with_suffix(".pyi")
        if stub.is_file():
            listed = parsed(stub.read_text(encoding="utf-8"))
            tree = ast.Module([*tree.body, *listed.body], [])
        dotted = f"{package.name}." + path.removesuffix(".py").replace("/", ".")
        yield dotted.removesuffix(".__init__"), path, tree


def _module(name: str, path: str, tree: ast.Module) -> _Module:
    found = _Module(path, path.endswith("__init__.py"))
    waiting = list(tree.body)
    while waiting:
        node = waiting.pop(0)
        if isinstance(node, _Definition) and any("overload" in ast.unparse(each) for each in node.decorator_list):
            found.runs.append(node)  # Numba calls it in place of what it overloads
        elif isinstance(node, _Definition) and not node.name.startswith("__"):  # `__getattr__` is called by the import
            found.definitions.setdefault(node.name, []).append(node)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = [each.id for target in targets for each in ast.walk(target) if isinstance(each, ast.Name)]
            for each in names:
                found.definitions.setdefault(each, []).append(node)
        elif isinstance(node, ast.If | ast.Try):
            found.runs += [node.test] if isinstance(node, ast.If) else []
            waiting = [*node.body, *node.orelse, *getattr(node, "finalbody", []), *waiting]
        elif not isinstance(node, ast.Import | ast.ImportFrom):
            found.runs.append(node)
    own = name.split(".") if found.is_package else name.split(".")[:-1]
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            base = own[: len(own) - node.level + 1] if node.level else []
            base += node.module.split(".") if node.module else []
            for alias in node.names:
                found.bindings[alias.asname or alias.name] = ".".join([*base, alias.name])
        elif isinstance(node, ast.Import):
            for alias in node.names:
                first = alias.name.split(".")[0]
                found.bindings[alias.asname or first] = alias.name if alias.asname else first
    return found


def _roots(known: dict[str, _Module]) -> Iterator[tuple[str, str]]:
    """What a user can call: the names in the stubs, and each command, a function named as its module."""
    for module, found in known.items():
        if found.is_package:
            yield module, ""
            for target in found.bindings.values():
                yield from _resolved(target, known)
        parts = module.split(".")
        if "cli" in parts or parts[-1] == "__main__":
            commands = {"main", parts[-1], f"{parts[-1].removeprefix('import_')}_stage", "import_stage"}
            for name in commands & set(found.definitions):
                yield module, name


def _resolved(dotted: str, known: dict[str, _Module], depth: int = 0) -> Iterator[tuple[str, str]]:
    """The definition that a dotted name means, through the folders that pass it on."""
    parts = dotted.split(".")
    for count in range(len(parts), 0, -1):
        module = ".".join(parts[:count])
        if module not in known:
            continue
        yield module, ""
        if count < len(parts):
            name = parts[count]
            yield module, name
            passed_on = known[module].bindings.get(name)
            if passed_on and depth < 5 and passed_on != dotted:
                yield from _resolved(".".join([passed_on, *parts[count + 1 :]]), known, depth + 1)
        return


def _uses(node: ast.AST, own: str, known: dict[str, _Module]) -> Iterator[tuple[str, str]]:
    here = known[own]
    for each in ast.walk(node):
        if isinstance(each, ast.Name):
            if each.id in here.definitions:
                yield own, each.id
            if each.id in here.bindings:
                yield from _resolved(here.bindings[each.id], known)
        elif isinstance(each, ast.Attribute):
            parts = _chain(each)
            if parts and parts[0] in here.bindings:
                yield from _resolved(".".join([here.bindings[parts[0]], *parts[1:]]), known)
            yield from _by_name(each, known)


def _chain(node: ast.expr) -> list[str]:
    """`a.b.c` as its parts; empty for an attribute of anything but a name."""
    parts: list[str] = []
    while isinstance(node, ast.Attribute):
        parts.insert(0, node.attr)
        node = node.value
    return [node.id, *parts] if isinstance(node, ast.Name) else []


def _by_name(node: ast.Attribute, known: dict[str, _Module]) -> Iterator[tuple[str, str]]:
    """`import_module(f"relume.image.files.{module}").read`: that function of every module there."""
    call = node.value
    if not (isinstance(call, ast.Call) and ast.unparse(call.func).endswith("import_module") and call.args):
        return
    name = call.args[0]
    first = name.values[0] if isinstance(name, ast.JoinedStr) and name.values else name
    if isinstance(first, ast.Constant) and isinstance(first.value, str):
        for module, found in known.items():
            if module.startswith(first.value) and node.attr in found.definitions:
                yield module, node.attr
