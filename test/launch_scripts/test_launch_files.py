"""The launch files: arguments that explain themselves, and the processes of the command line."""

import ast
import re
from pathlib import Path

import pytest

from impact_rig.cli.rig_options import RIG_OPTIONS
from impact_rig.core.given.errors import ParameterError

FOLDER = Path(__file__).resolve().parent.parent.parent / "launch_scripts"
LAUNCH_FILES = sorted(FOLDER.glob("*.launch.py"))


def list_calls(path, name):
    """Return the keywords of each call of a function in a launch file, by its first argument."""
    return {
        node.args[0].value: {word.arg for word in node.keywords}
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == name
        and isinstance(node.args[0], ast.Constant)
    }


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.name)
def test_every_name_taken_from_the_package_exists(path):
    imports = [
        node
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module.split(".")[0] == "impact_rig"
    ]
    assert imports
    for statement in imports:
        # As the launch file does: a module of a package is one of its names once it is imported.
        names = ", ".join(name.name for name in statement.names)
        exec(f"from {statement.module} import {names}", {})


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.name)
def test_every_argument_is_described_and_used(path):
    arguments = list_calls(path, "DeclareLaunchArgument")
    assert all("description" in keywords for keywords in arguments.values())
    (listed,) = re.findall(
        r"^NAMES = (\(.*?\))", path.read_text("utf-8"), re.DOTALL | re.MULTILINE
    )
    assert set(list_calls(path, "read")) | {"rate", "loop"} >= {
        *arguments,
        *ast.literal_eval(listed),
    }


def test_a_number_that_cannot_be_meant_is_refused_by_a_launch_file():
    assert (RIG_OPTIONS["faults"].read("", "1"), RIG_OPTIONS["seed"].read("", "")) == (1.0, None)
    for name, text in (("faults", "1.01"), ("seed", "-1"), ("seed", "many"), ("loop", "0.5")):
        with pytest.raises(ParameterError, match=f"^{name} is .*: it must be"):
            RIG_OPTIONS[name].read(name, text)
