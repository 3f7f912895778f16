"""The shape of the repository: who may import whom, what must be explained."""

import ast
import functools
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from impact_rig.core.given.findings import Finding, Note
from impact_rig.results.campaign import Results

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "impact_rig"
MODULES = sorted(PACKAGE.rglob("*.py"))
NAMED = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for path in MODULES
}
INTERFACES = sorted(
    path for kind in ("msg", "srv", "action") for path in ROOT.glob(f"msg_config/{kind}/*")
)

SIDE_BY_SIDE = {"configuration", "devices", "recordings", "results"}
BELOW = {
    "core", "analysis", "files", "page", "present", "simulators", "status", *SIDE_BY_SIDE,
}  # fmt: skip
MAY_IMPORT = {
    "core": {"core"},
    **{name: {"core", name} for name in SIDE_BY_SIDE},
    "devices": {"core", "configuration", "devices"},
    "files": {"core", "configuration", "recordings", "files"},
    "simulators": {"core", "results", "simulators"},
    "status": {"core", "results", "status"},
    "present": {"core", "configuration", "page", "results", "status", "present"},
    "page": {"core", "results", "status", "page"},
    "analysis": {"core", "configuration", "files", "recordings", "results", "analysis"},
    "nodes": {"nodes", *BELOW} - {"analysis", "files", "simulators"},
    "cli": {"nodes", "cli", *BELOW},
    "api": BELOW - {"simulators"},
    "__init__": {"analysis", "api", "core", "present"},
    "testing": {
        "analysis",
        "api",
        "cli",
        "nodes",
        "testing",
        "core",
        "configuration",
        "devices",
        "present",
        "results",
    },
    "pytest_plugin": {"cli", "testing"},
}
"""Imports run one way; those side by side know nothing of each other, but for the devices,
whose tables come from the rig file. Other instruments' files become recordings. What shows results
knows results, and the state of a rig and its file, not where they come from; the
analysis makes them of files."""

CORE = ["given", "hit", "mean", "estimates", "session"]
"""The rooms of the core, from below, and what leads a hit through them."""

PURE = {
    "GTC", "abc", "array", "cmath", "collections", "dataclasses", "enum", "functools", "itertools",
    "math", "numbers", "numpy", "operator", "re", "scipy", "sys", "types", "typing", "zlib",
}  # fmt: skip
"""What the core may import: nothing here reads a clock, a file or the network."""

ROS = {"rclpy", "rcl_interfaces", "std_srvs"}
WRAPS = {
    "core": {"GTC"},
    "configuration": {"pint", "yaml"},
    "devices": {"nidaqmx", "opendaq", "pyvisa", "pyvisa_py", "serial", "sounddevice"},
    "files": {"RigolWFM", "h5py", "nptdms", "pyarrow", "python_calamine", "pyuff"},
    "recordings": {"lz4", "mcap", "mcap_protobuf", "rosbags", "yaml", "zstandard"},
    "analysis": {"dask", "distributed"},
    "page": {"jinja2", "tornado"},
    "api": {"matplotlib"},
    "present": {"jinja2", "matplotlib", "pyarrow", "rerun", "rich"},
    "nodes": ROS,
    "testing": ROS,
    "cli": {"click", "rich", "segno"},
}  # fmt: skip
"""Which libraries a package wraps, and no other may import; those of messages are for nodes."""
IMPORTED_WHEN_USED = set.union(*WRAPS.values()) - ROS - {
    "click", "lz4", "mcap", "rich", "rosbags", "tornado", "yaml", "zstandard",
}  # fmt: skip
"""What takes long to import: all libraries but these."""

FIELD = re.compile(
    r"^(?P<type>[\w/]+)(?:\[[\d<=]*\])?\s+(?P<name>\w+)\s*(?P<default>[^#=\s]+)?\s*"
)
SELF_EXPLAINING = {"std_msgs/Header header", "bool success"}
NUMBER = re.compile(r"^(?:u?int\d+|float\d+)$")


def name_module(path: Path) -> str:
    return str(path.relative_to(ROOT))


def find_package(path: Path) -> str:
    """Return the part of impact_rig that a module belongs to."""
    return Path(path.relative_to(PACKAGE).parts[0]).stem


def walk(node: ast.AST, *, at_import_time: bool) -> Iterator[ast.AST]:
    """Yield the nodes below, without what runs only when called, or never."""
    for child in ast.iter_child_nodes(node):
        is_deferred = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        is_typing = isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test)
        if at_import_time and (is_deferred or is_typing):
            continue
        yield child
        yield from walk(child, at_import_time=at_import_time)


@functools.cache
def parse(path: Path) -> ast.Module:
    return ast.parse(path.read_text("utf-8"))


@functools.cache
def list_imports(path: Path, *, at_import_time: bool = False) -> set[str]:
    """Return the dotted names a module imports."""
    names: set[str] = set()
    for node in walk(parse(path), at_import_time=at_import_time):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name_module(path)}: write the whole name of the package"
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return names


def list_modules(path: Path) -> set[str]:
    """Return the names of the package's own modules that a module imports."""
    found = {
        name if name in NAMED else name.rpartition(".")[0]
        for name in list_imports(path)
        if name.startswith("impact_rig.")
    }
    return found & set(NAMED) - {"impact_rig"}


def list_libraries(path: Path, *, at_import_time: bool = False) -> set[str]:
    """Return the top-level names a module imports."""
    return {name.split(".")[0] for name in list_imports(path, at_import_time=at_import_time)}


def find_offences(
    find: Callable[[Path], set[str]], paths: list[Path] = MODULES
) -> dict[str, set[str]]:
    """Return what each file has that it may not have; no entry: nothing."""
    return {name_module(path): offences for path in paths if (offences := find(path))}


def test_imports_run_one_way():
    def find(path):
        parts = {
            name.split(".")[1] for name in list_imports(path) if name.startswith("impact_rig.")
        }
        return parts & set(MAY_IMPORT) - MAY_IMPORT.get(find_package(path), set())

    assert find_offences(find) == {}


def test_modules_that_a_text_names_are_there():
    """They are imported when they are first used."""

    def find(path):
        text = path.read_text("utf-8")
        named = re.findall(r'"(impact_rig\.\w+\.[a-z_.]+)"', text)
        named += [f"impact_rig.{name}" for name in re.findall(r'\b_by\(\W*"([\w.]+)"', text)]
        return {*named} - NAMED.keys()

    assert find_offences(find) == {}


def test_the_core_has_four_rooms_and_its_session_which_know_only_those_below():
    def find(path):
        room = Path(path.relative_to(PACKAGE / "core").parts[0]).stem
        above = CORE[CORE.index(room) + 1 :] if room in CORE else CORE
        return {
            name.split(".")[2]
            for name in list_imports(path)
            if name.startswith("impact_rig.core.") and name.split(".")[2] in above
        }

    rooms = {path.stem for path in (PACKAGE / "core").iterdir() if path.suffix != ".md"}
    assert rooms - {"__pycache__"} == {"__init__", *CORE}
    assert find_offences(find, sorted((PACKAGE / "core").rglob("*.py"))) == {}


def test_no_files_import_one_another_in_a_circle_and_the_core_has_few_floors():
    imports = {name: list_modules(path) for name, path in NAMED.items()}
    floors: dict[str, int] = {}

    def find_floor(name: str, above: tuple[str, ...] = ()) -> int:
        assert name not in above, f"a circle: {' > '.join(above[above.index(name) :])} > {name}"
        if name not in floors:
            below = [find_floor(other, (*above, name)) for other in sorted(imports[name])]
            floors[name] = 1 + max(below, default=0)
        return floors[name]

    for name in imports:
        find_floor(name)
    assert max(floors[name] for name in imports if name.startswith("impact_rig.core")) <= 20


def test_the_core_is_arithmetic_only():
    def find(path):
        called = {
            node.func.id
            for node in ast.walk(parse(path))
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        }
        forbidden = called & {"open", "print", "input", "eval", "exec", "__import__"}
        return forbidden | list_libraries(path) - PURE - {"impact_rig"}

    assert find_offences(find, sorted((PACKAGE / "core").rglob("*.py"))) == {}


def test_only_the_modules_of_uncertainty_calculate_with_uncertain_numbers():
    loaders = {path.name for path in MODULES if "GTC" in list_libraries(path)}
    assert loaders == {"uncertainty.py"}
    users = {path.name for path in MODULES if "load_gtc(" in path.read_text()}
    assert users == {"uncertainty.py"}


def test_a_library_is_imported_only_by_the_package_that_wraps_it():
    wrapped = set.union(*WRAPS.values())

    def find(path):
        package = find_package(path)
        libraries = list_libraries(path)
        wraps = WRAPS.get(package, set())
        messages = {name for name in libraries if name.endswith("_msgs") and not wraps >= ROS}
        return libraries & wrapped - wraps | messages

    assert find_offences(find) == {}


def test_what_takes_long_to_import_is_imported_when_it_is_used():
    def find(path):
        return list_libraries(path, at_import_time=True) & IMPORTED_WHEN_USED

    assert find_offences(find) == {}


def test_the_help_of_the_command_line_waits_for_no_heavy_library():
    code = "import sys, impact_rig.cli.main; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"numpy", "scipy", "rich", "rclpy", "rerun", "mcap", "rosbags", "pint"} & set(
        loaded
    )


@pytest.mark.parametrize("path", INTERFACES, ids=name_module)
def test_every_field_of_an_interface_has_its_meaning_and_each_number_its_unit(path):
    unexplained = []
    for line in path.read_text("utf-8").splitlines():
        declaration, _, comment = (part.strip() for part in line.partition("#"))
        field = FIELD.match(declaration)
        if field is None or "=" in declaration or declaration in SELF_EXPLAINING:
            continue
        if path.suffix != ".msg" and field["type"][0].isupper():
            continue  # a message of our own, explained in its file
        is_number = NUMBER.match(field["type"])
        if not re.search(r"\[[^\]]+\]|constants" if is_number else r"\w", comment):
            unexplained.append(field["name"])
    assert not unexplained


def test_no_sentence_decides_what_is_found_and_noted_is_a_code_with_a_sentence():
    told = {"notes", "warnings", "reasons", "findings"}
    assert {(item, hint) for item, hint in _list_results(Results) if item in told} == {
        ("notes", tuple[Note, ...]),
        ("warnings", tuple[Note, ...]),
        ("reasons", tuple[Finding, ...]),
        ("reasons", tuple[Note, ...]),
        ("findings", tuple[Finding, ...]),
    }


def _list_results(kind: type) -> Iterator[tuple[str, object]]:
    """Yield name and type of every field of a result, and of the results within it."""
    for item in fields(kind):
        hint = get_type_hints(kind)[item.name]
        yield item.name, hint
        for inner in get_args(hint) or (hint,):
            if is_dataclass(inner) and inner not in (Finding, Note, kind):
                yield from _list_results(inner)
