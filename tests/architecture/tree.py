"""What the package's files say: its modules as syntax trees, and what each imports."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGE = REPOSITORY / "src" / "relume"
LISTS = Path(__file__).parent / "not_yet"

# What compiles a function: see src/relume/image/kernel.py.
KERNELS = {"kernel", "inlined", "exact_kernel", "exact_inlined", "exact_small"}


def modules(package: Path) -> Iterator[tuple[str, ast.Module]]:
    """Every module of the package: its path inside it, and its syntax tree.

    What lies in a folder `scripts` is data: other programs run it, and relume never imports it.
    """
    for file in sorted(package.rglob("*.py")):
        if file.parent.name == "scripts":
            continue
        yield file.relative_to(package).as_posix(), parsed(file.read_text(encoding="utf-8"))


@cache
def parsed(text: str) -> ast.Module:
    """Each rule looks at every module; no rule changes what it looks at."""
    return ast.parse(text)


@cache
def imports(path: str, tree: ast.Module, package: str = "relume") -> list[tuple[int, str]]:
    """The line and full dotted name of everything a module imports, wherever in the module and however spelt."""
    return list(_imports(path, tree, package))


def _imports(path: str, tree: ast.Module, package: str) -> Iterator[tuple[int, str]]:
    own_package = [package, *path.split("/")[:-1]]
    for node in nodes(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name
        elif isinstance(node, ast.ImportFrom):
            base = own_package[: len(own_package) - node.level + 1] if node.level else []
            base += node.module.split(".") if node.module else []
            for alias in node.names:
                yield node.lineno, ".".join([*base, alias.name])
        elif isinstance(node, ast.Call) and called_name(node) in ("import_module", "__import__") and node.args:
            target = node.args[0]
            if isinstance(target, ast.Constant) and isinstance(target.value, str):
                yield node.lineno, target.value


def called_name(call: ast.Call) -> str:
    """The last name in what is called: `imread` of `cv2.imread(…)`."""
    return call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")


def imported_modules(package: Path) -> dict[str, set[str]]:
    """Which modules each module imports, at its top or inside a function; a name of a stub is the module it names."""
    paths, stubs = {}, {}
    for path, _ in modules(package):
        name = f"{package.name}." + path.removesuffix(".py").replace("/", ".")
        paths[name.removesuffix(".__init__")] = path
        stub = (package / path).with_suffix(".pyi")
        if stub.is_file():
            here = name.removesuffix(".__init__")
            for _, target in imports(path, parsed(stub.read_text(encoding="utf-8"))):
                stubs[f"{here}.{target.rpartition('.')[2]}"] = target
    arrows: dict[str, set[str]] = {}
    for path, tree in modules(package):
        targets = set()
        for _, name in imports(path, tree):
            while name in stubs and stubs[name] != name:
                name = stubs[name]
            targets |= {paths[each] for each in (name, name.rpartition(".")[0]) if each in paths}
        arrows[path] = targets - {path}
    return arrows


@cache
def nodes(tree: ast.Module) -> tuple[ast.AST, ...]:
    """Everything in a module, however deep."""
    return tuple(ast.walk(tree))


@cache
def functions(tree: ast.Module) -> list[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
    """Every function of a module, with its qualified name: `Film.developed`."""
    return list(_functions(tree))


def _functions(tree: ast.Module) -> Iterator[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
    waiting: list[tuple[str, ast.AST]] = [("", tree)]
    while waiting:
        prefix, parent = waiting.pop(0)
        for node in ast.iter_child_nodes(parent):
            inside = prefix
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                yield prefix + node.name, node
                inside = f"{prefix}{node.name}."
            elif isinstance(node, ast.ClassDef):
                inside = f"{prefix}{node.name}."
            waiting.append((inside, node))


def decorators(node: ast.FunctionDef | ast.AsyncFunctionDef) -> set[str]:
    return {ast.unparse(each.func if isinstance(each, ast.Call) else each) for each in node.decorator_list}


def is_kernel(node: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    return bool(decorators(node) & KERNELS)


def listed(name: str) -> set[str]:
    """The places that a rule does not hold for yet. Take lines out; add none."""
    file = LISTS / f"{name}.txt"
    lines = file.read_text(encoding="utf-8").splitlines() if file.is_file() else []
    return {line for line in lines if line and not re.match("#", line)}


CACHES = (parsed, imports, nodes, functions)
"""What holds syntax trees."""
