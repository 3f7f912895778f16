"""Ends of commands: an error in one line, Ctrl-C silently."""

import contextlib
import errno
import os
import sys
from typing import IO, Any

import click

from impact_rig.cli.libraries import explain_missing
from impact_rig.core.given.errors import RigError

EXIT_ERROR = 2  # something that the user can mend
EXIT_INTERRUPTED = 130  # ended by Ctrl-C: 128 + SIGINT, as in shells


class _Failure(click.ClickException):
    """An error in one line on standard error."""

    exit_code = EXIT_ERROR

    def show(self, file: IO[Any] | None = None) -> None:
        from impact_rig.present.console import make_printable

        text = make_printable(f"error: {self.format_message()}")
        click.echo(text, file=file, err=file is None)


class RigGroup(click.Group):
    """A click group that turns errors into one line, and Ctrl-C into a quiet end."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands, the main job first."""
        return list(self.commands)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command."""
        try:
            with explain_missing():
                result = super().invoke(ctx)
            sys.stdout.flush()
            return result
        except RigError as error:
            raise _Failure(str(error)) from None
        except click.Abort as error:  # raised by a prompt in place of what ended it
            click.echo(err=True)
            if isinstance(error.__context__, EOFError):
                raise _Failure("the input ended before the question was answered") from None
            ctx.exit(EXIT_INTERRUPTED)
        except KeyboardInterrupt:
            ctx.exit(EXIT_INTERRUPTED)
        except OSError as error:
            if error.errno == errno.EPIPE:  # the reader of a pipe has ended: click ends quietly
                raise
            # What standard output did not take would be tried once more at the end.
            with contextlib.suppress(OSError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            where = f"{error.filename}: " if error.filename else ""
            raise _Failure(f"{where}{error.strerror or error}") from None
