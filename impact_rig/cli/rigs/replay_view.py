"""What a person sees of a replay, and says to it."""

import os
import select
import sys
import time
from collections.abc import Mapping
from typing import Any

import click
from rich.console import Console
from rich.progress import TextColumn

from impact_rig.cli.progress_bar import ProgressBar
from impact_rig.nodes.replayer import ReplayerNode
from impact_rig.nodes.replaying.replay_host import ReplayHost
from impact_rig.reporting.terminal.console import make_console

DISCOVERY_TIME = 1.0
"""How long those who listen already may take to be found [s], our choice: on one host it is
tenths."""
DRAWING_PERIOD = 0.1
"""How often the progress is drawn anew [s]."""
STANDARD_INPUT = 0
QUIT = "q"


class ReplayView(ProgressBar):
    """Follows a replay on standard error; use it in a ``with`` statement.

    Parameters
    ----------
    console : Console
        Where to draw, if it is a terminal.
    """

    def __init__(self, console: Console) -> None:
        super().__init__(console, "opening", TextColumn("{task.fields[place]}"), place="")
        self._drawn = 0.0

    def follow(self, replayer: ReplayerNode) -> None:
        """Show how far the replay is."""
        if time.monotonic() - self._drawn < DRAWING_PERIOD:
            return
        self._drawn = time.monotonic()
        state, rate = replayer.describe_state(), replayer.get_value("rate")
        speed = f"{rate:g} x" if rate else "as fast as possible"
        record = f"record {state['record']}, " if state["record"] else ""
        self.update(
            description=f"{state['message']}, {speed}",
            total=state["duration"] or None,
            completed=state["position"],
            place=f"{record}{state['position']:.1f} of {state['duration']:.1f} s",
        )


def play(parameters: Mapping[str, Any], namespace: str, *, by_steps: bool) -> None:
    """Replay a recording into the ROS domain at hand.

    Parameters
    ----------
    parameters : mapping
        Of the replayer.
    namespace : str
        To replay in.
    by_steps : bool
        Whether a person asks for one hit after the other.

    Raises
    ------
    RigError
        If the recording cannot be replayed, or is damaged.
    """
    with (
        ReplayHost(parameters, namespace) as host,
        ReplayView(make_console(stderr=True)) as view,
    ):
        for warning in host.open().warnings:
            click.echo(f"warning: {warning}", err=True)
        host.spin(DISCOVERY_TIME)
        if parameters["required_subscribers"]:
            click.echo(f"waiting for {parameters['required_subscribers']}", err=True)
        asker = _Asker(host.replayer) if by_steps else None

        def follow() -> bool:
            view.follow(host.replayer)
            return asker is None or asker.look()

        host.play(follow)
    click.echo(f"{host.replayer.describe_state()['messages']} messages replayed", err=True)


class _Asker:
    """Makes a step for each line that comes in."""

    def __init__(self, replayer: ReplayerNode) -> None:
        self._replayer = replayer
        self._is_asked = False

    def look(self) -> bool:
        """Make a step if one is asked for; return whether to go on."""
        state = self._replayer.describe_state()
        if not self._replayer.is_paused:
            return True
        if not self._is_asked:
            self._is_asked = True
            if state["record"]:
                click.echo(f"record {state['record']} replayed", err=True)
            click.echo("Enter: the next hit; q: end", err=True)
        if not select.select([sys.stdin], [], [], 0.0)[0]:
            return True
        # Not through sys.stdin: what it keeps back, select does not see.
        line = os.read(STANDARD_INPUT, 1024).decode(errors="replace")
        if not line or line.strip().lower() == QUIT:
            return False
        self._is_asked = False
        self._replayer.step()
        return True
