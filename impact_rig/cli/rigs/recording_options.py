"""Options that say how a run is recorded."""

import functools
from collections.abc import Callable
from typing import Any

import click

from impact_rig.configuration.processes import RecordingPlan
from impact_rig.recording.writing.chunk_builder import COMPRESSIONS


def recording_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add options that make one `RecordingPlan`, `recording`."""

    @functools.wraps(command)
    def joined(
        *, bag: bool, compression: str | None, notes: str, record_stream: bool, **values: Any
    ) -> Any:
        plan = RecordingPlan(bag, compression or "", notes, record_stream)
        return command(recording=plan, **values)

    for option in (
        click.option(
            "--record-stream",
            is_flag=True,
            help="With --continuous: record the whole stream, 20 MB a second before compression,"
            " not only the impacts in it.",
        ),
        click.option(
            "--notes", default="", metavar="TEXT", help="What the recording should say of itself."
        ),
        click.option(
            "--compression",
            type=click.Choice(COMPRESSIONS),
            help="Of the recording. [zstd]",
        ),
        click.option(
            "--bag/--no-bag",
            default=False,
            help="Record into a folder as rosbag2 writes it, not into one file. [no]",
        ),
    ):
        joined = option(joined)
    return joined


def list_recording_arguments(recording: RecordingPlan) -> list[str]:
    """Return a plan as the words of a command line."""
    arguments = ["--bag"] if recording.bag else []
    arguments += ["--record-stream"] if recording.stream else []
    for name, value in (("--compression", recording.compression), ("--notes", recording.notes)):
        if value:
            arguments += [name, value]
    return arguments
