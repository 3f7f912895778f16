"""``impact-rig bench``: the benchmarks, which lie beside the sources and are not installed."""

import importlib
import sys
from pathlib import Path

import click

from impact_rig.core.errors import FileError

TESTS = Path(__file__).resolve().parents[2] / "test"


@click.command("bench", context_settings={"ignore_unknown_options": True, "help_option_names": []})
@click.argument("words", nargs=-1, type=click.UNPROCESSED)
def missing(words: tuple[str, ...]) -> None:  # noqa: ARG001 - whatever is asked, it is not there
    """Measure what is claimed, on this machine."""
    raise FileError(
        f"the benchmarks are not installed: there is no {TESTS / 'bench'}; they belong to the"
        " sources, where `python3 launch_scripts/rig.py bench` runs them"
    )


def load_command(tests: Path) -> click.Command:
    """Return the command that the benchmarks offer, or one that says where they are."""
    if not (tests / "bench" / "command.py").is_file():
        return missing
    if str(tests) not in sys.path:
        sys.path.insert(0, str(tests))
    command: click.Command = importlib.import_module("bench.command").command
    return command


command = load_command(TESTS)
