"""Files of oscilloscopes (Agilent, Keysight, LeCroy, Rigol, Siglent, Tektronix …), by RigolWFM."""

import contextlib
import io
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from impact_rig.core.given.errors import FileError
from impact_rig.files.measurement import MeasuredChannel, Measurement
from impact_rig.files.times import round_rate

UNITS = {"v": "V", "a": "A", "w": "W"}
"""RigolWFM's names of them."""
ASSUMING = {"lecroy_trc", "rohde_schwarz_bin", "tek_isf", "tek_wfm", "yokogawa_wfm"}
"""Parsers of RigolWFM that take every channel for volts, whatever its file states."""
FLOAT32 = 2.0**-24
"""Largest error of a number in four bytes over the number [-]: some state the step so."""
MARK, BYTE_ORDER, SEGMENTS = b"WAVEDESC", 34, 144
"""What LeCroy's description of a waveform begins with, and where in it the order of bytes and the
number of segments stand [byte]."""


def read_scope(path: Path) -> Measurement:
    """Read the channels that an oscilloscope saved; each frame or segment of one is a channel.

    Raises
    ------
    FileError
        If no channel of it can be read.
    """
    from RigolWFM.wfm import Wfm

    with contextlib.redirect_stderr(io.StringIO()) as complaint:
        first = Wfm.from_file(str(path))
        further = range(1, first.frame_count)
        frames = [first, *(Wfm.from_file(str(path), frame=at) for at in further)]
    if not first.channels:
        words = " ".join(complaint.getvalue().split())
        raise FileError(f"{path} holds no analogue channel that can be read: {words}")
    parts = _count_segments(path)
    channels: list[MeasuredChannel] = []
    for frame, waveform in enumerate(frames, 1):
        for channel in waveform.channels:
            place = f" frame {frame}" if len(frames) > 1 else ""
            channels += _split_channel(channel, waveform.parser_name, place, parts)
    return Measurement(path, tuple(channels))


def _split_channel(channel: Any, parser: str, place: str, parts: int) -> Iterator[MeasuredChannel]:
    """Yield a channel, or each of its segments."""
    step = float(channel.seconds_per_point)
    size, rest = divmod(channel.volts.size, parts)
    if rest:
        raise ValueError(f"{channel.volts.size} points cannot be those of {parts} segments")
    for part in range(parts):
        yield MeasuredChannel(
            channel.name + place + (f" segment {part + 1}" if parts > 1 else ""),
            channel.volts[part * size : (part + 1) * size],
            round_rate(step, FLOAT32 * step),
            "" if parser in ASSUMING else _name_unit(channel.unit),
            start=float(channel.times[0]),
        )


def _name_unit(unit: Any) -> str:
    """Return a unit; some parsers give the number of it in a list of Keysight's."""
    from RigolWFM.mso5000 import UnitEnum

    return UNITS.get(getattr(unit, "name", None) or UnitEnum(unit).name, "")


def _count_segments(path: Path) -> int:
    """Return how many segments of LeCroy's follow each other; 1: there is one, or none."""
    data = path.read_bytes()
    place = data.find(MARK)
    if place < 0 or len(data) < place + SEGMENTS + 4:
        return 1
    order = "<" if data[place + BYTE_ORDER] == 1 else ">"
    (number,) = struct.unpack_from(f"{order}i", data, place + SEGMENTS)
    return max(int(number), 1)
