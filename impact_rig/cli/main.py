"""The command `impact-rig`: finds its subcommands when they are called, and ends errors well."""

import errno
import io
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import click

from impact_rig import __version__
from impact_rig.cli.libraries import find_library
from impact_rig.cli.start import load_module
from impact_rig.configuration.processes import open_closed_streams, use_one_thread
from impact_rig.core.errors import RigError

EXIT_ERROR = 2
"""Something that the user can mend."""
EXIT_INTERRUPTED = 130
"""Ended by Ctrl-C: 128 + SIGINT, as shells have it."""


@dataclass(frozen=True)
class _Entry:
    """A subcommand: what it does in a few words, and where it is declared."""

    help: str
    module: str
    name: str = "command"


LIGHT = "impact_rig.cli.commands"
COMMANDS = {
    "demo": _Entry("Run a whole campaign on the virtual rig.", "impact_rig.cli.demo"),
    "up": _Entry("Start the nodes of a rig, real or virtual.", "impact_rig.cli.up"),
    "campaign": _Entry("Run a campaign on a rig that is up.", "impact_rig.cli.campaign"),
    "devices": _Entry("See which devices are found, and try them.", LIGHT, "devices"),
    "calibrate": _Entry("Find a sensor's sensitivity from hits.", LIGHT, "calibrate"),
    "hammer": _Entry("Arm, disarm or stop the hammer of a rig.", "impact_rig.cli.hammer"),
    "analyze": _Entry("Estimate from recordings or plain traces.", LIGHT, "analyze"),
    "info": _Entry("See what a recording holds, and whether it is sound.", LIGHT, "info"),
    "replay": _Entry("Publish a recording again.", LIGHT, "replay"),
    "import": _Entry("Make a recording of other instruments' files.", LIGHT, "import_"),
    "export": _Entry("Write hits, mean traces and results for others.", LIGHT, "export"),
    "view": _Entry("See model and measurement in Rerun.", LIGHT, "view"),
    "report": _Entry("Write a report of one run or several.", LIGHT, "report"),
    "doctor": _Entry("See what is installed and what is broken.", LIGHT, "doctor"),
}
"""The help lists them without loading their modules."""


class _Failure(click.ClickException):
    """An error in one line on standard error."""

    exit_code = EXIT_ERROR

    def show(self, file: IO[Any] | None = None) -> None:
        from impact_rig.present.terminal.console import make_printable

        text = make_printable(f"error: {self.format_message()}")
        click.echo(text, file=file, err=file is None)


class RigGroup(click.Group):
    """A click group that imports a subcommand's module only when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the subcommands, the main job first."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return a subcommand; None for an unknown name."""
        entry = COMMANDS.get(cmd_name)
        if entry is None:
            return None
        command: click.Command = getattr(load_module(entry.module), entry.name)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the subcommands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, entry.help) for name, entry in COMMANDS.items()])

    def invoke(self, ctx: click.Context) -> Any:
        """Run a subcommand; errors become one line, Ctrl-C a quiet end."""
        try:
            result = super().invoke(ctx)
            sys.stdout.flush()
            return result
        except RigError as error:
            raise _Failure(str(error)) from None
        except ModuleNotFoundError as error:
            library = find_library(error.name or "")
            if library is None:
                raise
            raise _Failure(
                f"this needs {library.name}: Python finds no module {error.name!r}:"
                f" {library.advice}"
            ) from None
        except click.Abort as error:  # raised by a prompt in place of what ended it
            click.echo(err=True)
            if isinstance(error.__context__, EOFError):
                raise _Failure("input ended while an answer was awaited") from None
            ctx.exit(EXIT_INTERRUPTED)
        except KeyboardInterrupt:
            ctx.exit(EXIT_INTERRUPTED)
        except OSError as error:
            if error.errno == errno.EPIPE:  # the reader of a pipe has ended: click ends quietly
                raise
            if error.filename == _StandardOutput.TITLE:
                # What could not be written would be tried once more at the end.
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            where = f"{error.filename}: " if error.filename else ""
            raise _Failure(f"{where}{error.strerror or error}") from None


@click.command(
    cls=RigGroup,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="""
    \b
    Examples:
      impact-rig demo                          the whole job, no hardware needed
      impact-rig analyze session.mcap          the tables of a recorded campaign
      impact-rig analyze --cutoff off hit*.npy contact times of plain traces
      impact-rig doctor                        when something does not work
      impact-rig COMMAND --help                more about one command
    """,
)
@click.version_option(__version__, "--version", prog_name="impact-rig")
def cli() -> None:
    """Strike samples with a pendulum hammer and estimate contact time, stiffness and damping."""


class _StandardOutput(io.FileIO):
    """Standard output whose errors name it, as those of opening a file name that."""

    TITLE = "standard output"

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            error.filename = self.TITLE
            raise


def _keep_standard_output() -> None:
    """Keep standard output for what Python prints: Fast DDS writes its errors there, into JSON."""
    sys.stdout.flush()
    sys.stdout = io.TextIOWrapper(
        io.BufferedWriter(_StandardOutput(os.dup(1), "w")),
        encoding=sys.stdout.encoding,
        line_buffering=sys.stdout.isatty(),
    )
    os.dup2(2, 1)


def main() -> None:
    """Run the command line; never returns."""
    open_closed_streams()
    use_one_thread()
    os.environ.setdefault("HOME", str(Path.home()))  # rclpy's log folder needs it
    _keep_standard_output()
    for stream in (sys.stdout, sys.stderr):
        # A terminal without Greek letters shows question marks, not a traceback.
        stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    cli(prog_name="impact-rig")


if __name__ == "__main__":
    main()
