"""rig.py tells people what it wants, and hands over to the command."""

import ast
import os
import sys
from pathlib import Path

import pytest
import rig

SCRIPT = Path(rig.__file__)


def write_command(folder, name, script):
    path = folder / name
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)


def test_an_old_python_can_read_the_file():
    ast.parse(SCRIPT.read_text("utf-8"), feature_version=(3, 7))


@pytest.mark.parametrize("version", [(3, 8), (3, 10), (3, 14), (4, 0)])
def test_a_python_that_will_not_do_is_named_with_those_that_will(version):
    reason = rig.check_python(version)
    assert "Python 3.11 to 3.13" in reason
    assert f"this is Python {version[0]}.{version[1]}" in reason
    assert not any(map(rig.check_python, [(3, 11), (3, 12), (3, 13)]))


@pytest.mark.parametrize("arguments", [["--help"], ["-h"], ["help"]])
def test_the_help_names_every_command(arguments, capsys):
    assert rig.main(arguments) == 0
    help_text = capsys.readouterr().out
    for command in ("demo", "test", "exec", "shell"):
        assert f"\n  {command} " in help_text


@pytest.mark.parametrize("arguments", [[], ["nonsense"], ["exec"], ["exec", "--"]])
def test_a_wrong_command_gets_the_usage(arguments, capsys):
    assert rig.main(arguments) == 2
    assert capsys.readouterr().err.startswith("usage: ")


def test_the_command_takes_the_place_of_rig_py(fresh, run_rig):
    done = run_rig("exec", "--", sys.executable, "-c", "import sys; print('there'); sys.exit(7)")
    assert (done.code, done.output, done.errors) == (7, "there\n", "")


def test_the_python_that_set_it_up_goes_on_where_another_was_called(fresh, run_rig):
    folder = fresh.venv / "bin"
    folder.mkdir()
    write_command(folder, "python3", 'echo "$0" "$@"')
    script = fresh.root / "launch_scripts" / "rig.py"
    assert run_rig("exec", "true").output == f"{folder / 'python3'} {script} exec true\n"


def test_a_command_that_does_not_exist_is_named(fresh, run_rig):
    done = run_rig("exec", "--", "no-such-command")
    assert done.code == rig.NOT_FOUND
    assert done.errors == "error: no-such-command: No such file or directory\n"


def test_demo_is_the_command_line_s(fresh, run_rig):
    folder = fresh.venv / "bin"
    folder.mkdir()
    write_command(folder, "impact-rig", 'echo "$@"')
    assert run_rig("demo", "--impacts", "3", "--help").output == "demo --impacts 3 --help\n"


@pytest.mark.parametrize("failing", [None, "ruff", "mypy", "pytest"])
def test_all_checks_run_and_one_that_fails_is_enough(failing, tmp_path, capfd):
    for name in ("ruff", "mypy", "pytest"):
        write_command(tmp_path, name, f"echo ran {name} $@; exit {int(name == failing)}")
    code = rig.run_checks({"PATH": f"{tmp_path}{os.pathsep}/bin"}, str(tmp_path), ["-k", "pulse"])
    output = capfd.readouterr().out
    assert code == (0 if failing is None else 1)
    tests = " ".join(["pytest", *rig.PARALLEL, "-k", "pulse"])
    for ran in ("ruff check .", "ruff format --check .", "mypy", tests):
        assert f"ran {ran}" in output
    assert output.count("FAILED") == {None: 0, "ruff": 2}.get(failing, 1)
