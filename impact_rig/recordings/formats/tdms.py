"""National Instruments' TDMS, by npTDMS."""

import logging
import math
import struct
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from impact_rig.core.errors import FileError
from impact_rig.recordings.formats.measurement import (
    NANOSECONDS,
    Measurement,
    NamedArray,
    check_claim,
    make_measurement,
    make_unique,
    round_rate,
)

GROUP = "traces"
"""Where channels are written."""
STEP, START, UNIT = "wf_increment", "wf_start_offset", "unit_string"
RECORDED_AT = "wf_start_time"
"""National Instruments' names of what belongs to a waveform."""
RATE, NAME = "sampling_rate", "name"
"""Ours: the step alone would not bring each rate back to the last bit, nor the path each name."""

EPOCH = 2_082_844_800
"""Seconds from 1904, which these files count from, to 1970."""
FRACTION_BITS = 64
"""Of a second, in their times."""

SIGNATURE = b"TDSm"
LEAD_IN = 28
"""What each segment begins with [byte]."""
BIG_ENDIAN = 1 << 6
"""Flag of a segment."""
SCALED_SIZE = 8
"""Bytes of a float64, which one byte in the file may become by its scaling."""


def read_tdms(path: Path) -> Measurement:
    """Read the channels of numbers, scaled as the file says.

    Channels are named by their group, too, if there are several. Each may state in UTC when it was
    recorded.

    Raises
    ------
    FileError
        If the file is no TDMS, is cut off, or has no channel of real numbers.
    SignalError
        If it has a channel of times that do not run in even steps.
    """
    from nptdms import TdmsFile

    logging.getLogger("nptdms").setLevel(logging.ERROR)  # what matters of it is checked here
    _check_segments(path)
    # As an open file: an index beside it may be of another one.
    with path.open("rb") as file, TdmsFile.open(file, raw_timestamps=True) as tdms:
        groups = tdms.groups()
        arrays = [
            _read_channel(path, channel, f"{group.name}/" if len(groups) > 1 else "")
            for group in groups
            for channel in group.channels()
        ]
    return make_measurement(path, arrays)


def _read_channel(path: Path, channel: Any, group: str) -> NamedArray:
    properties = channel.properties
    check_claim(path, channel.name, len(channel), SCALED_SIZE)
    step = _read_number(properties, STEP)
    return NamedArray(
        name=str(properties.get(NAME, group + channel.name)),
        values=np.asarray(channel[:]) if len(channel) else np.empty(0),
        sampling_rate=_read_number(properties, RATE, round_rate(step)),
        unit=str(properties.get(UNIT, "")),
        start=_read_number(properties, START, 0.0),
        is_channel=RATE in properties or step > 0,
        recorded_at=_read_time(properties),
    )


def _read_time(properties: dict[str, Any]) -> int:
    """Return when a channel was recorded [ns since the epoch], to the nearest; 0: not stated."""
    from nptdms.timestamp import TdmsTimestamp

    time = properties.get(RECORDED_AT)
    if not isinstance(time, TdmsTimestamp):
        return 0
    fraction = round(Fraction(NANOSECONDS * time.second_fractions, 2**FRACTION_BITS))
    return NANOSECONDS * (int(time.seconds) - EPOCH) + fraction


def _make_time(recorded_at: int) -> Any:
    from nptdms.timestamp import TdmsTimestamp

    seconds, rest = divmod(recorded_at, NANOSECONDS)
    return TdmsTimestamp(seconds + EPOCH, (rest << FRACTION_BITS) // NANOSECONDS)


def _read_number(properties: dict[str, Any], name: str, default: float = math.nan) -> float:
    value = properties.get(name, default)
    return float(value) if isinstance(value, (int, float, np.number)) else default


def _check_segments(path: Path) -> None:
    """Refuse a file that ends before its last segment does."""
    size = path.stat().st_size
    position = 0
    with path.open("rb") as file:
        while position < size:
            file.seek(position)
            lead_in = file.read(LEAD_IN)
            if lead_in[:4] != SIGNATURE:
                raise FileError(
                    f"{path} is no sound .tdms file: a segment should begin at {position} bytes"
                )
            if len(lead_in) == LEAD_IN:
                flags = struct.unpack_from("<I", lead_in, 4)[0]
                order = ">" if flags & BIG_ENDIAN else "<"
                position += LEAD_IN + struct.unpack_from(f"{order}Q", lead_in, 12)[0]
            if len(lead_in) < LEAD_IN or position > size:
                raise FileError(f"{path} is cut off: its last segment is not complete")


def write_tdms(path: Path, measurement: Measurement) -> None:
    """Write channels as waveforms of one group.

    Parameters
    ----------
    path : Path
        Of the new file.
    measurement : Measurement
        What to write.
    """
    from nptdms import ChannelObject, TdmsWriter

    channels = measurement.channels
    names = make_unique([channel.name for channel in channels], str)
    objects = []
    for name, channel in zip(names, channels, strict=True):
        properties = {
            RATE: channel.sampling_rate,
            UNIT: channel.unit,
            START: channel.start,
            "wf_samples": channel.values.size,
        }
        if not math.isnan(channel.sampling_rate):
            properties[STEP] = 1.0 / channel.sampling_rate
        if channel.recorded_at:
            properties[RECORDED_AT] = _make_time(channel.recorded_at)
        if name != channel.name:
            properties[NAME] = channel.name
        objects.append(ChannelObject(GROUP, name, channel.values, properties))
    with TdmsWriter(str(path)) as writer:
        writer.write_segment(objects)
