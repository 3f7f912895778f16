"""The command `impact-rig` itself: its help, its speed, and how it ends."""

import errno
import io
import signal
import sys
from pathlib import Path

import click
import pytest
from terminal import run_program

from impact_rig.cli import main
from impact_rig.core.given.errors import ParameterError

from .conftest import finish, start_command, start_python


@pytest.mark.parametrize("name", main.cli.commands)
def test_the_help_of_every_command_has_examples_and_fits_one_screen(run, name):
    outcome = run(name, "--help")
    assert outcome.exit_code == 0
    assert "Examples:" in outcome.stdout
    lines = outcome.stdout.splitlines()
    assert len(lines) <= 50
    assert max(map(len, lines)) <= 100


@pytest.mark.parametrize(
    ("raised", "code", "words"),
    [
        (ParameterError("mass is -1 kg: it must be above zero"), 2, "error: mass is -1 kg"),
        (ModuleNotFoundError("No module", name="rclpy.node"), 2, "error: rclpy is not installed"),
        (KeyboardInterrupt(), 130, ""),
        (OSError(errno.ENOSPC, "No space left", "/tmp/x"), 2, "error: /tmp/x: No space left\n"),
        (OSError(errno.ENOSPC, "No space left"), 2, "error: No space left\n"),
    ],
)
def test_what_a_command_raises_ends_in_one_line(run, monkeypatch, raised, code, words):
    @click.command()
    def broken():
        raise raised

    monkeypatch.setattr(main.cli, "get_command", lambda *_: broken)
    outcome = run("demo")
    assert outcome.exit_code == code
    assert outcome.stdout == ""
    assert len(outcome.stderr.splitlines()) == (1 if words else 0)
    assert outcome.stderr.startswith(words)


def test_a_bug_of_ours_is_not_hidden(monkeypatch):
    @click.command()
    def broken():
        raise ModuleNotFoundError("No module named 'impact_rig.cor'", name="impact_rig.cor")

    monkeypatch.setattr(main.cli, "get_command", lambda *_: broken)
    with pytest.raises(ModuleNotFoundError):
        main.cli(["demo"])


def test_ctrl_c_while_a_command_loads_ends_it_silently(tmp_path):
    (tmp_path / "slow.py").write_text("import os, signal; os.kill(os.getpid(), signal.SIGINT)")
    code = "from impact_rig.cli.start import load_module; load_module('slow'); print('late')"
    process = start_python("-c", code, env={"PYTHONPATH": str(tmp_path)})
    assert finish(process) == (-signal.SIGINT, "", "")


def test_a_prompt_without_input_is_an_error(run, monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))

    @click.command()
    def ask():
        click.prompt("Mount the sample", err=True)

    monkeypatch.setattr(main.cli, "get_command", lambda *_: ask)
    outcome = run("demo")
    assert outcome.exit_code == 2
    assert outcome.stderr.endswith("error: the input ended before the question was answered\n")


def test_a_terminal_without_greek_letters_gets_no_traceback():
    code = (
        "import click; from impact_rig.cli import main\n"
        "main.cli.get_command = lambda *_: click.Command('a', callback=lambda: print('τp'))\n"
        "main.main()"
    )
    ascii_only = {"PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    process = start_python("-c", code, "demo", env=ascii_only)
    assert finish(process) == (0, "?p\n", "")


def test_what_the_middleware_prints_does_not_get_into_the_output(ros_domain, tmp_path):
    code = (
        "import click, rclpy; from impact_rig.cli import main\n"
        "def work():\n"
        "    rclpy.init(); rclpy.create_node('peer').destroy_node(); rclpy.shutdown()\n"
        "    print('{}')\n"
        "main.cli.get_command = lambda *_: click.Command('a', callback=work)\n"
        "main.main()"
    )
    profile = tmp_path / "broken.xml"
    profile.write_text("<")
    settings = {"FASTRTPS_DEFAULT_PROFILES_FILE": str(profile)}
    exit_code, output, errors = finish(start_python("-c", code, "demo", env=settings))
    assert (exit_code, output) == (0, "{}\n")
    assert "broken.xml" in errors


def test_output_to_a_full_disk_ends_in_a_sentence():
    with Path("/dev/full").open("w") as full:
        done = finish(start_command("import", "--template", stdout=full))
    assert done == (2, None, "error: No space left on device\n")


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-"])
def test_a_stream_that_is_closed_is_as_good_as_the_null_device(closed):
    code = (
        "import click; from impact_rig.cli import main\n"
        "def ask(): print(click.prompt('Mount the sample', err=True))\n"
        "main.cli.get_command = lambda *_: click.Command('a', callback=ask)\n"
        "main.main()"
    )

    def run(redirection):
        words = ["sh", "-c", f'"$@" {redirection}', "sh", sys.executable, "-c", code, "demo"]
        done = run_program(words, input="done\n")
        return done.returncode, done.stdout, done.stderr

    assert run(closed) == run(closed.replace("&-", "/dev/null"))
