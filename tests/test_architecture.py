"""The layout of the package, as rules that a machine checks: imports follow the light, each heavy part has one door.

Every rule is a function from the package's folder to the list of what breaks it, so that each is also shown a small
package with a planted fault and has to find it.
"""

from __future__ import annotations

import ast
import gc
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

import relume
from architecture.kernels import PROOFS, kernels_without_proof
from architecture.lengths import functions_too_long, functions_without_steps
from architecture.reached import unreached
from architecture.strike_off import faults
from architecture.tree import (
    CACHES,
    PACKAGE,
    REPOSITORY,
    called_name,
    imported_modules,
    imports,
    listed,
    modules,
    nodes,
)
from architecture.words import lines_too_long, private_words

# The light's way through the package: a folder imports itself and those before it (docs/decisions/0001).
ORDER = [
    "cluster",
    "image",
    "sphere",
    "capture",
    "probe",
    "light",
    "scene",
    "renderers",
    "virtual_camera",
    "composite",
    "lightstage",
    "project",
    "export",
    "report",
]
ORDER += ["cli", "studio"]
BELOW_ALL = ["errors"]  # a single module any folder may import; it imports nothing of ours
ABOVE_ALL = ["", "__main__"]  # the package's own __init__ and `python -m relume` see everything
USERS_OF_THE_PUBLIC_API = ["cli", "studio"]  # they alone may say `import relume`

IMAGE_READERS = {"OpenEXR", "OpenImageIO", "PIL", "rawpy", "imageio", "imagecodecs", "tifffile"}
IMAGE_FILE_CALLS = {"imread", "imwrite", "imdecode", "imencode", "imsave"}  # cv2, matplotlib and imageio spell it so
# Path in the package → the reason why it may, beside image/files/.
MAY_OPEN_IMAGES: dict[str, str] = {"virtual_camera/tone/display/lettering.py": "draws words on pixels, opens no file"}
RENDERERS = {"mitsuba", "drjit", "mitsuba_oidn"}
# Where import and distribution differ in name.
INSTALLED_AS = {
    "PIL": "pillow",
    "cv2": "opencv-python-headless",
    "skimage": "scikit-image",
    "PyOpenColorIO": "opencolorio",
    "pxr": "usd-core",
    "openjd": "openjd-cli",
}
NAMES_WITHOUT_MEANING = {"utils", "util", "common", "core", "helpers", "types"}
LONGEST = 400
MOST_PUBLIC_NAMES = 80
MOST_PUBLIC_MODULES = 13
MOST_LINES_OF_COMMANDS = 6500
MOST_ENTRIES = 20
# Path in the package → the reason why it is not split.
MAY_BE_LONGER: dict[str, str] = {}
HEAVY = [
    "numpy",
    "numba",
    "scipy",
    "mitsuba",
    "drjit",
    "cv2",
    "OpenImageIO",
    "OpenEXR",
    "trimesh",
    "pydantic",
    "matplotlib",
    "rich",
]


# What a module says


def folder_of(path: str) -> str:
    """The part of the package a path belongs to: its folder, or the module's name at the top ("" for __init__)."""
    top = path.split("/")[0].removesuffix(".py")
    return "" if top == "__init__" else top


def is_within(path: str, *places: str) -> bool:
    return path.startswith(places)


# The rules


def imports_against_the_light(package: Path) -> list[str]:
    """Imports of a folder that lies further down the light's way, of the whole package, or from an unknown folder."""
    faults = []
    parts = {folder_of(path) for path, _ in modules(package)} - {""}
    for path, tree in modules(package):
        here = folder_of(path)
        if here in ABOVE_ALL:
            continue
        if here not in ORDER + BELOW_ALL:
            faults.append(f"{path}: {here} has no place in the order")
            continue
        allowed = set(BELOW_ALL) | set(ORDER[: ORDER.index(here) + 1]) if here in ORDER else set()
        for line, name in imports(path, tree):
            top, _, rest = name.partition(".")
            if top != "relume":
                continue
            there = rest.split(".")[0]
            if here in USERS_OF_THE_PUBLIC_API:
                continue  # what these may import is `inner_modules_behind_the_public_names`
            if there not in parts:  # a name of the package itself: `import relume`, `from relume import merge`
                faults.append(f"{path}:{line}: imports {name}; inside the package, import from the module itself")
            elif there not in allowed:
                faults.append(f"{path}:{line}: imports {name}, which lies downstream of {here}")
    return faults


def inner_modules_behind_the_public_names(package: Path) -> list[str]:
    """Imports in cli/ and studio/ that reach past the public names: they parse, call and show, and nothing else."""
    return [
        f"{path}:{line}: {name}"
        for path, tree in modules(package)
        if folder_of(path) in USERS_OF_THE_PUBLIC_API
        for line, name in imports(path, tree)
        if re.match(r"relume\.\w+\.", name)
        and not is_within(name, *(f"relume.{user}." for user in USERS_OF_THE_PUBLIC_API))
    ]


def circles(package: Path) -> list[str]:
    """Modules that import each other, directly or by way of others, wherever the import stands."""
    arrows = imported_modules(package)
    faults: dict[frozenset[str], str] = {}
    for start in arrows:
        # The shortest way back to where it starts.
        came_from, waiting = {}, [start]
        while waiting and start not in came_from:
            here = waiting.pop(0)
            for there in sorted(arrows[here] - set(came_from)):
                came_from[there] = here
                waiting.append(there)
        if start in came_from:
            way = [came_from[start]]
            while way[-1] != start:
                way.append(came_from[way[-1]])
            faults.setdefault(frozenset(way), " → ".join([*reversed(way), start]))
    return list(faults.values())


def folders_too_full(package: Path) -> list[str]:
    """Folders in which a reader loses the thread."""
    entries: dict[str, set[str]] = {}
    for file in package.rglob("*"):
        if file.suffix in (".py", ".pyi", ".toml", ".typed"):
            parts = file.relative_to(package).parts
            for depth, part in enumerate(parts):
                entries.setdefault("/".join(parts[:depth]), set()).add(part)
    return [f"{folder}: {len(each)} entries" for folder, each in entries.items() if len(each) > MOST_ENTRIES]


def images_opened_elsewhere(package: Path) -> list[str]:
    """Uses of an image reader outside image/files/."""
    faults = []
    for path, tree in modules(package):
        if is_within(path, "image/files/") or path in MAY_OPEN_IMAGES:
            continue
        faults += [
            f"{path}:{line}: {name}" for line, name in imports(path, tree) if name.split(".")[0] in IMAGE_READERS
        ]
        calls = (node for node in nodes(tree) if isinstance(node, ast.Call))
        faults += [
            f"{path}:{call.lineno}: {called_name(call)}()" for call in calls if called_name(call) in IMAGE_FILE_CALLS
        ]
    return faults


def mitsuba_imported_elsewhere(package: Path) -> list[str]:
    """Imports of Mitsuba or Dr.Jit outside renderers/mitsuba/."""
    return [
        f"{path}:{line}: {name}"
        for path, tree in modules(package)
        if not is_within(path, "renderers/mitsuba/")
        for line, name in imports(path, tree)
        if name.split(".")[0] in RENDERERS
    ]


def names_without_meaning(package: Path) -> list[str]:
    """Modules and folders named after no noun of the field."""
    paths = (path for path, _ in modules(package))
    return [path for path in paths if NAMES_WITHOUT_MEANING & set(path.removesuffix(".py").split("/"))]


def talk_outside_the_command_line(package: Path) -> list[str]:
    """Calls in the library that print or end the program: that is for the command line alone."""
    faults = []
    for path, tree in modules(package):
        if folder_of(path) in ("cli", "__main__"):
            continue
        for node in nodes(tree):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Name)
                and node.func.id in ("print", "exit", "quit")
            ):
                faults.append(f"{path}:{node.lineno}: {node.func.id}()")
            elif isinstance(node, ast.Attribute) and ast.unparse(node) in ("sys.exit", "os._exit"):
                faults.append(f"{path}:{node.lineno}: {ast.unparse(node)}")
            elif isinstance(node, ast.Name) and node.id == "SystemExit":
                faults.append(f"{path}:{node.lineno}: SystemExit")
    return faults


def modules_without_a_docstring(package: Path) -> list[str]:
    return [path for path, tree in modules(package) if not ast.get_docstring(tree)]


def modules_too_long(package: Path) -> list[str]:
    lengths = {path: len((package / path).read_text(encoding="utf-8").splitlines()) for path, _ in modules(package)}
    return [f"{path}: {n} lines" for path, n in lengths.items() if n > LONGEST and path not in MAY_BE_LONGER]


def undeclared_imports(package: Path, declared: set[str]) -> list[str]:
    """Imports of a package that is neither Python's, nor ours, nor declared (as a distribution) in pyproject.toml."""
    folders = [folder for folder in (package, package / "support") if folder.is_dir()]
    own = {"relume"} | {file.stem for folder in folders for file in folder.iterdir()}
    faults = []
    for path, tree in modules(package):
        for line, name in imports(path, tree):
            top = name.split(".")[0]
            if top in own or top in sys.stdlib_module_names:
                continue
            if spelling(INSTALLED_AS.get(top, top)) not in declared:
                faults.append(f"{path}:{line}: {top}")
    return faults


def spelling(distribution: str) -> str:
    """A distribution's name without extras and bounds, as package indexes compare them."""
    return re.sub(r"[-_.]+", "-", re.split(r"[\[<>=!~; ]", distribution)[0]).lower()


def declared_parts(*extras: str) -> set[str]:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    parts = list(project["dependencies"])
    for extra in extras:
        parts += project["optional-dependencies"][extra]
    return {spelling(part) for part in parts}


def heavy_modules_loaded_by(statement: str, package: Path) -> list[str]:
    """The heavy libraries that a fresh Python has loaded after the statement."""
    probe = f"import sys\n{statement}\nprint(*[name for name in {HEAVY!r} if name in sys.modules])"
    environment = {**os.environ, "PYTHONPATH": str(package.parent)}
    done = subprocess.run([sys.executable, "-c", probe], env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


# The package keeps them


@pytest.fixture(scope="module", autouse=True)
def trees() -> Iterator[None]:
    """Two million nodes: not looked through for garbage again and again, and let go for the tests that come after."""
    gc.disable()
    for each in (PACKAGE, REPOSITORY / "tests"):
        _ = list(modules(each))
    gc.freeze()
    gc.enable()
    yield
    for kept in CACHES:
        kept.cache_clear()


def test_imports_point_one_way_along_the_light():
    assert imports_against_the_light(PACKAGE) == []


def test_the_command_line_uses_the_public_names_alone():
    assert inner_modules_behind_the_public_names(PACKAGE) == []


def test_no_modules_import_each_other():
    assert circles(PACKAGE) == []


def test_no_folder_is_too_full():
    assert folders_too_full(PACKAGE) == []


def test_only_image_files_opens_images():
    assert images_opened_elsewhere(PACKAGE) == []


def test_only_the_mitsuba_modules_import_mitsuba():
    assert mitsuba_imported_elsewhere(PACKAGE) == []


def test_no_module_is_named_after_nothing():
    assert names_without_meaning(PACKAGE) == []


def test_the_library_neither_prints_nor_exits():
    assert talk_outside_the_command_line(PACKAGE) == []


def test_every_module_opens_with_a_docstring():
    assert modules_without_a_docstring(PACKAGE) == []


def test_no_module_is_longer_than_a_reader_can_hold():
    assert modules_too_long(PACKAGE) == []


def test_no_place_uses_a_private_word():
    not_yet = listed("words")
    assert [fault for fault in private_words(REPOSITORY) if fault.split(":")[0] not in not_yet] == []


def test_no_line_of_a_document_is_too_long():
    not_yet = listed("long_lines")
    assert [fault for fault in lines_too_long(REPOSITORY) if fault.split(":")[0] not in not_yet] == []


def test_everything_is_reached_by_a_command_or_a_public_name():
    assert sorted(set(unreached(PACKAGE)) - listed("unreached")) == []


def test_no_function_is_longer_than_a_screen_or_two():
    not_yet = listed("long_functions")
    assert [fault for fault in functions_too_long(PACKAGE) if fault.split(": ")[0] not in not_yet] == []


def test_a_long_function_names_its_steps():
    not_yet = listed("bare_functions")
    assert [fault for fault in functions_without_steps(PACKAGE) if fault.split(": ")[0] not in not_yet] == []


@pytest.mark.parametrize("name", ["words", "long_lines", "unreached", "long_functions", "bare_functions"])
def test_the_lists_of_places_not_yet_mended_can_only_shrink(name):
    assert sorted(listed(name) - faults()[name]) == []  # `python -m architecture.strike_off` takes these off


def test_the_commands_parse_call_and_print_in_few_lines():
    lines = sum(len(file.read_text(encoding="utf-8").splitlines()) for file in PACKAGE.glob("cli/**/*.py"))
    assert lines <= MOST_LINES_OF_COMMANDS


def test_every_kernel_has_a_proof():
    assert kernels_without_proof(PACKAGE, REPOSITORY / "tests", PROOFS) == []


def test_every_exception_to_a_rule_is_still_needed_and_says_why():
    for path, reason in {**MAY_OPEN_IMAGES, **MAY_BE_LONGER}.items():
        assert (PACKAGE / path).is_file(), f"{path} is gone; take it off the list"
        assert reason.strip(), path


def test_every_part_the_package_imports_is_declared():
    assert (
        undeclared_imports(PACKAGE, declared_parts("studio", "cluster", "lightstage", "ocio", "usd", "video", "heif"))
        == []
    )


def test_every_part_the_tests_import_is_declared():
    assert undeclared_imports(REPOSITORY / "tests", declared_parts("cluster", "lightstage", "ocio", "usd", "dev")) == []


def test_importing_relume_loads_no_heavy_library():
    assert heavy_modules_loaded_by("import relume", PACKAGE) == []


def test_reading_a_shot_loads_no_compiled_loop_and_no_renderer():
    """The studio reads it before its address is said, and a command before it refuses it: half of that time."""
    loaded = heavy_modules_loaded_by("import relume.project.shot_file.shot", PACKAGE)
    assert sorted(loaded) == ["cv2", "numpy", "pydantic"]


def test_every_public_name_can_be_had():
    found = {name: getattr(relume, name) for name in vars(relume)["__all__"]}
    assert found.keys() <= set(dir(relume))
    assert sum(isinstance(value, ModuleType) for value in found.values()) <= MOST_PUBLIC_MODULES
    # Names are the real things, not stand-ins.
    homes = {
        name: value.__name__ if isinstance(value, ModuleType) else value.__module__ for name, value in found.items()
    }
    assert [name for name, home in homes.items() if not home.startswith("relume.")] == []


def test_the_public_names_fit_on_a_page():
    count = "import relume\nnames = relume.__all__\nassert 0 < len(set(names)) == len(names), names\n"
    count += f"assert len(names) <= {MOST_PUBLIC_NAMES}, len(names)"
    assert heavy_modules_loaded_by(count, PACKAGE) == []


# Each rule finds a planted fault, and only that


def planted(root: Path, files: dict[str, str]) -> Path:
    """A small sound package under root, with these files added."""
    sound = {
        "__init__.py": '"""Names."""\n',
        "errors.py": '"""Errors."""\n',
        "image/__init__.py": '"""Pixels."""\n',
        "image/b.py": '"""Half a circle, should there be a module a."""\nfrom relume.image.a import x\n',
        "image/files/__init__.py": '"""Files."""\nimport OpenEXR\nfrom PIL import Image\n',
        "renderers/__init__.py": '"""Renders."""\nfrom relume import errors\nfrom ..image import files\n',
        "renderers/mitsuba/variant.py": '"""Variant."""\nimport drjit\nimport mitsuba as mi\n',
        "cli/__init__.py": '"""Commands."""\nimport sys\nimport relume as rl\nprint(rl)\nsys.exit(0)\n',
        "cli/info.py": '"""A command."""\nfrom relume.cli import lines\ndef info():\n    return lines.line()\n',
        "cli/lines.py": '"""Lines."""\ndef line():\n    return 1\n',
        "sphere/__init__.pyi": "from .c import f as f\n",
        "sphere/__init__.py": '"""The names of its stub."""\n',
        "sphere/c.py": SPHERE,
        "../../README.md": "| " + "a table " * 20 + "\n[an address](https://" + "a" * 120 + ")\n",
    }
    package = root / "src" / "relume"
    for path, text in {**sound, **files}.items():
        (package / path).parent.mkdir(parents=True, exist_ok=True)
        (package / path).write_text(text, encoding="utf-8")
    return package


def undeclared(package: Path) -> list[str]:
    return undeclared_imports(package, {"openexr", "pillow", "mitsuba", "drjit"})


def kernels_near(package: Path) -> list[str]:
    tests = package.parents[1] / "tests"
    tests.mkdir(exist_ok=True)
    (tests / "test_c.py").write_text("from relume.sphere.c import f\n", encoding="utf-8")
    proofs = {path: ("test_c.py", "a twin") for path in ("sphere/c.py", "image/proved_elsewhere.py")}
    return kernels_without_proof(package, tests, {each: proofs[each] for each in proofs if (package / each).exists()})


def private_words_near(package: Path) -> list[str]:
    return private_words(package.parents[1])


def lines_too_long_near(package: Path) -> list[str]:
    return lines_too_long(package.parents[1])


def heavy_after_import(package: Path) -> list[str]:
    return heavy_modules_loaded_by("import relume", package)


RULES: list[Callable[[Path], list[str]]] = [
    imports_against_the_light,
    inner_modules_behind_the_public_names,
    circles,
    folders_too_full,
    images_opened_elsewhere,
    mitsuba_imported_elsewhere,
    names_without_meaning,
    talk_outside_the_command_line,
    modules_without_a_docstring,
    modules_too_long,
    undeclared,
    heavy_after_import,
    private_words_near,
    lines_too_long_near,
    functions_too_long,
    functions_without_steps,
    unreached,
    kernels_near,
]

NO_DOCSTRING = "x = 1\n"
LINE = "  x = 1\n"
SPHERE = f'''"""A castellated, retold sphere."""
from relume.sphere.e import x


def f():
    return D


@kernel
def D():
    # One.
    # Two.
    # Three.
{LINE * 100}
'''
FAULTS: dict[str, tuple[Callable[[Path], list[str]], str, str]] = {
    "image imports renderers": (imports_against_the_light, "image/a.py", "from relume.renderers import x"),
    "image imports renderers relatively": (imports_against_the_light, "image/a.py", "from ..renderers import x"),
    "image imports renderers from the package": (
        imports_against_the_light,
        "image/a.py",
        "from relume import renderers",
    ),
    "image imports renderers inside a function": (
        imports_against_the_light,
        "image/a.py",
        "def f():\n    import relume.renderers",
    ),
    "image imports renderers by its name": (
        imports_against_the_light,
        "image/a.py",
        "import importlib\nimportlib.import_module('relume.renderers')",
    ),
    "a renderer uses the public names": (imports_against_the_light, "renderers/a.py", "import relume"),
    "errors imports image": (imports_against_the_light, "errors.py", "from relume import image"),
    "a command reaches behind the public names": (
        inner_modules_behind_the_public_names,
        "cli/a.py",
        "def f():\n    from relume.image.files import read",
    ),
    "two modules import each other": (
        circles,
        "image/a.py",
        "from relume.image.b import x",
    ),
    "two modules import each other inside functions": (
        circles,
        "image/a.py",
        "def f():\n    from relume.image import b",
    ),
    "two modules import each other by a stub's name": (circles, "sphere/e.py", "from relume.sphere import f"),
    "a folder outside the order": (imports_against_the_light, "extra/a.py", ""),
    "a composite opens an image": (images_opened_elsewhere, "composite/a.py", "import OpenEXR"),
    "a composite opens an image by hand": (
        images_opened_elsewhere,
        "composite/a.py",
        "def f(cv2):\n    cv2.imread('a')",
    ),
    "image itself opens an image": (images_opened_elsewhere, "image/a.py", "from PIL.Image import open"),
    "a composite renders": (mitsuba_imported_elsewhere, "composite/a.py", "import mitsuba as mi"),
    "another renderer uses Dr.Jit": (mitsuba_imported_elsewhere, "renderers/whitted.py", "from drjit import auto"),
    "a module named utils": (names_without_meaning, "image/utils.py", ""),
    "a folder named core": (names_without_meaning, "image/core/a.py", ""),
    "the library prints": (talk_outside_the_command_line, "image/a.py", "print('hello')"),
    "the library exits": (talk_outside_the_command_line, "image/a.py", "import sys\nsys.exit(1)"),
    "the library raises SystemExit": (talk_outside_the_command_line, "image/a.py", "raise SystemExit"),
    "a module without a docstring": (modules_without_a_docstring, "image/a.py", NO_DOCSTRING),
    "a module too long": (modules_too_long, "image/a.py", "x = 1\n" * LONGEST),
    "a part nobody declared": (undeclared, "image/a.py", "import numpy"),
    "a function nobody calls": (unreached, "image/a.py", "def f():\n    pass"),
    "a circle that nobody enters": (unreached, "image/a.py", "def f():\n    return g()\n\n\ndef g():\n    return f()"),
    "a constant nobody reads": (unreached, "image/files/a.py", "MOST = 3"),
    "a function too long": (functions_too_long, "image/a.py", f"def f():\n{LINE * 100}"),
    "a method too long": (functions_too_long, "image/a.py", f"class A:\n def f(self):\n{LINE * 100}"),
    "a function without steps": (functions_without_steps, "image/a.py", f"def f():\n{LINE * 50}"),
    "a function with notes to tools alone": (
        functions_without_steps,
        "image/a.py",
        f"def f():\n{LINE * 50}{LINE.rstrip()}  # noqa\n{LINE.rstrip()}  # fmt: skip\n    # a step",
    ),
    "a kernel without steps": (functions_without_steps, "image/a.py", f"@kernel\ndef f():\n{LINE * 50}"),
    "a kernel that no test proves": (kernels_near, "image/a.py", "@exact_kernel\ndef f():\n    return 1"),
    "a kernel whose proof does not reach it": (
        kernels_near,
        "image/proved_elsewhere.py",
        "@kernel\ndef f():\n    return 1",
    ),
    "a kernel on the table that is none": (kernels_near, "sphere/c.py", "def f():\n    return 1"),
    "a private word in a sentence": (private_words_near, "image/a.py", "# Told by the header."),
    "a private word in a name": (private_words_near, "image/a.py", "is_told = True"),
    "a private word in a class": (private_words_near, "image/a.py", "class FilmTold:\n    pass"),
    "a private word in a document": (private_words_near, "../../docs/a.md", "The header tells it."),
    "a long line in a document": (lines_too_long_near, "../../README.md", "word " * 25),
    "a heavy import at the top": (heavy_after_import, "__init__.py", "import numpy"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_the_rule_finds_the_planted_fault(fault, tmp_path):
    rule, path, code = FAULTS[fault]
    text = code if code is NO_DOCSTRING else f'"""A module."""\n{code}\n'
    assert rule(planted(tmp_path, {path: text})) != []


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_the_rule_finds_nothing_in_a_sound_package(rule, tmp_path):
    assert rule(planted(tmp_path, {})) == []
