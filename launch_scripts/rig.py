#!/usr/bin/env python3
"""Set this workspace up where it stands, and run a command in it. Needs nothing but Python.

This file is kept readable for any Python 3, so that a Python that is too old can be told so.
"""

import os
import signal
import sys
import time
from pathlib import Path

USAGE = """\
usage: python3 launch_scripts/rig.py COMMAND

  demo [OPTIONS]     run a whole campaign on the virtual rig; all of `impact-rig demo`'s options
  bench [OPTIONS]    measure what is claimed; `bench --help` names the parts
  test [OPTIONS]     lint, format, types and tests; the options go to pytest
  exec -- CMD ...    run any command: nodes, `impact-rig`, `python3`
  shell              open a shell in which all of the above are commands

The first call sets up: a Python environment in .venv with ROS 2 Jazzy from wheels, and both
packages, built into install/. It takes about a minute and needs a C++ compiler; later calls start
at once, with the Python of the first one, and build again only what has changed. Delete .venv to
choose another Python. With a ROS 2 Jazzy installation sourced, that one is used instead of the
wheels.

  python3 launch_scripts/rig.py demo --sample "aluminium large" --impacts 3
  python3 launch_scripts/rig.py test -k pulse
  python3 launch_scripts/rig.py exec -- impact-rig --help
  python3 launch_scripts/rig.py exec -- impact-rig analyze runs/*/session.mcap
"""

OLDEST = (3, 11)
NEWEST = (3, 13)
PARALLEL = ["--numprocesses=auto", "--dist=loadfile", "--no-loadscope-reorder"]
"""Later options of pytest go before them."""
WRITES = "the set-up writes into this folder; use a clone of your own on a disk with space left."
INTERRUPTED = 128 + signal.SIGINT
NOT_FOUND = 127


def check_python(version: "tuple[int, ...]") -> "str | None":
    """Return why a Python of this version cannot be used; None: it can."""
    if OLDEST <= tuple(version[:2]) <= NEWEST:
        return None
    return (
        "error: rig.py runs on Python {}.{} to {}.{}, and this is Python {}.{}: "
        "call it with another, for example `python3.12 launch_scripts/rig.py`.".format(
            *(OLDEST + NEWEST + tuple(version[:2]))
        )
    )


def go_on_with_first_python(root: Path) -> None:
    """Run this script again by the Python that set it up, if that is another."""
    venv = root / ".venv"
    python = venv / "bin" / "python3"
    is_set_up = (venv / ".stamp-python").exists() and python.exists()
    if is_set_up and not os.environ.get("ROS_DISTRO") and Path(sys.prefix) != venv:
        said = venv / "pyvenv.cfg"
        ours = f"home = {sys.base_prefix}/bin\n"
        if not said.exists() or ours not in said.read_text("utf-8"):
            os.execv(str(python), [str(python), *sys.argv])


def run_checks(environment: "dict[str, str]", root: str, options: "list[str]") -> int:
    """Run lint, format, types and tests, all of them; return 0 if all passed."""
    results = []
    for command in (
        ["ruff", "check", "."],
        ["ruff", "format", "--check", "."],
        ["mypy"],
        ["pytest", *PARALLEL, *options],
    ):
        print("$ " + " ".join(command), flush=True)
        start = time.monotonic()
        code = run_and_wait(command, environment, root)
        results.append((" ".join(command[:2]), code, time.monotonic() - start))
        if code == INTERRUPTED:
            break
    print()
    for name, code, duration in results:
        print("{:<14} {:<8} {:6.1f} s".format(name, "FAILED" if code else "passed", duration))
    return max(code for _, code, _ in results)


def run_and_wait(command: "list[str]", environment: "dict[str, str]", folder: str) -> int:
    """Run a command to its end, even after Ctrl-C, which it receives too; return its code."""
    import subprocess  # here: it takes as long to load as all else of `exec`

    process = subprocess.Popen(command, env=environment, cwd=folder)
    try:
        code = process.wait()
    except KeyboardInterrupt:
        process.wait()
        return INTERRUPTED
    return code if code >= 0 else 128 - code


def become(command: "list[str]", environment: "dict[str, str]") -> int:
    """Replace this process by a command; return only if there is no such command."""
    sys.stdout.flush()
    try:
        os.execvpe(command[0], command, environment)
    except OSError as error:
        print(f"error: {command[0]}: {error.strerror}", file=sys.stderr)
    return NOT_FOUND


def main(arguments: "list[str]") -> int:
    """Run one command of `USAGE`; return its exit code."""
    reason = check_python(sys.version_info[:2])
    if reason is not None:
        print(reason, file=sys.stderr)
        return 2
    command, options = (arguments[0], arguments[1:]) if arguments else ("", [])
    if command == "exec" and options[:1] == ["--"]:
        del options[0]
    if command in ("help", "-h", "--help"):
        print(USAGE, end="")
        return 0
    is_known = command in ("demo", "bench", "test", "exec", "shell")
    if not is_known or (command == "exec" and not options):
        print(USAGE, end="", file=sys.stderr)
        return 2
    return run(command, options)


def run(command: str, options: "list[str]") -> int:
    """Set up what is not, and run one command of `USAGE`; return its exit code."""
    import workspace

    go_on_with_first_python(Path(__file__).resolve().parent.parent)
    try:
        place = workspace.find_workspace()
        if workspace.find_stale(place):
            import workspace_setup

            workspace_setup.set_up(place)
        environment = workspace.make_environment(place, os.environ)
    except workspace.SetupError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"error: {error.filename}: {error.strerror}: {WRITES}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\ninterrupted: the next call goes on with the set-up", file=sys.stderr)
        return INTERRUPTED
    if command == "test":
        return run_checks(environment, str(place.root), options)
    if command == "shell":
        print("the rig's shell: `impact-rig --help` to start, `exit` to leave")
        shell = os.environ.get("SHELL") or "/bin/sh"
        start_up = ["--rcfile", str(place.root / "launch_scripts" / "shell.bash")]
        return become([shell, *(start_up if Path(shell).name == "bash" else [])], environment)
    words = options
    if command == "demo":
        words = ["impact-rig", command, *options]
    elif command == "bench":
        paths = [str(place.root / "test"), environment.get("PYTHONPATH", "")]
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
        words = ["python3", "-m", "bench", *options]
    return become(words, environment)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
