"""Points of a channel, as an instrument sends them, and as a block holds them."""

import numpy as np

from impact_rig.core.signals.record import ChannelBlock, RawArray
from impact_rig.devices.acceleration_source import SourceChannel
from impact_rig.devices.scpi.connection import ScpiConnection
from impact_rig.devices.scpi.program import ASCII, ChannelProgram

LONGEST_NUMBER = 32
"""Characters of a number that is sent as text, comma and space included, our choice."""


def fetch_points(
    connection: ScpiConnection, program: ChannelProgram, start: int, points: int
) -> RawArray:
    """Return the points of one channel.

    Parameters
    ----------
    connection : ScpiConnection
        To the instrument.
    program : ChannelProgram
        How to ask.
    start : int
        Where the record begins in the instrument's memory.
    points : int
        Of the record.

    Returns
    -------
    ndarray of int32 or float64, shape (points,)
        Counts, or numbers where the instrument sends such.

    Raises
    ------
    DeviceError
        If it does not answer, or not with so many numbers.
    """
    for command in program.commands:
        connection.send(command)
    query = program.query.replace("{start}", str(start))
    if program.points_format == ASCII:
        values = _parse_text(connection, query, points)
    else:
        kind = np.dtype(program.points_format)
        # One more than wanted: a longer record is named by its length, below.
        data = connection.ask_block(query, 2 * points * kind.itemsize)
        if len(data) % kind.itemsize:
            raise connection.make_nonsense_error(query, data, f"numbers of {kind.itemsize} bytes")
        values = np.frombuffer(data, kind)
    if values.size != points:
        raise connection.make_error(
            f"answers {query} with {values.size} points: the record has {points}"
        )
    if values.dtype.kind == "f":
        if not np.all(np.isfinite(values)):
            raise connection.make_error(f"answers {query} with what is no number")
        return values.astype(np.float64)
    return values.astype(np.int32)


def make_channel_block(
    output: RawArray, program: ChannelProgram, channel: SourceChannel
) -> ChannelBlock:
    """Return points with their calibration, and whether they reach the rails."""
    low, high = program.rails
    scale = channel.find_scale() * program.step
    return ChannelBlock(
        output=output,
        scale=scale,
        offset=-program.zero * scale,
        full_scale=channel.find_full_scale(program.input_range),
        overloaded=bool(np.any((output <= low) | (output >= high))),
    )


def _parse_text(connection: ScpiConnection, query: str, points: int) -> RawArray:
    """Ask for numbers as text."""
    text = connection.ask(query, 2 * points * LONGEST_NUMBER)
    try:
        return np.array([float(word) for word in text.strip("{}").split(",")])
    except ValueError:
        raise connection.make_nonsense_error(query, text, "numbers with commas") from None
