"""National Instruments' TDMS, by npTDMS."""

import contextlib
import logging
import math
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from impact_rig.files.formats.arrays import NamedArray, make_measurement, read_stated_rate
from impact_rig.files.formats.bounds import check_size
from impact_rig.files.measurement import NANOSECONDS, ORIGIN, Measurement, make_unique
from impact_rig.files.times import TIME_UNITS, normalize_time_unit, round_rate

STEP, START, UNIT = "wf_increment", "wf_start_offset", "unit_string"
STEP_UNIT = "wf_xunit_string"
RECORDED_AT = "wf_start_time"
"""National Instruments' names of what belongs to a waveform."""
RATE, NAME = "sampling_rate", "name"
"""Ours: the step alone would not bring each rate back to the last bit, nor the path each name."""

CUT = "Last segment of file has less data"
ODD_REST = "Data size "
"""Beginnings of what npTDMS prints of a file that is cut, and then of what is left of it."""
EPOCH = 2_082_844_800
"""Seconds from 1904, which these files count from, to 1970."""
FRACTION_BITS = 64
"""Bits of a fraction of a second in their times."""


def read_tdms(path: Path) -> Measurement:
    """Read the channels of numbers, scaled as the file says.

    Channels are named by their group, too, if there are several. Each may state in UTC when it was
    recorded.

    Raises
    ------
    FileError
        If the file is no TDMS, contradicts itself, or has no channel of real numbers. One that is
        cut at its end is read as far as it goes, and says so.
    """
    from nptdms import TdmsFile

    # As an open file: an index beside it may be of another one.
    with (
        path.open("rb") as file,
        _refuse_doubtful() as remarks,
        TdmsFile.open(file, raw_timestamps=True) as tdms,
    ):
        groups = tdms.groups()
        # 8 bytes of a number, at most.
        check_size(path, sum(8 * len(item) for group in groups for item in group.channels()))
        arrays = [
            _read_channel(
                path,
                channel,
                f"{group.name}/" if len(groups) > 1 else "",
                tdms.properties | group.properties | channel.properties,
            )
            for group in groups
            for channel in group.channels()
        ]
    return replace(make_measurement(path, arrays), remarks=tuple(remarks))


def _read_channel(path: Path, channel: Any, group: str, properties: dict[str, Any]) -> NamedArray:
    name = str(properties.get(NAME, group + channel.name))
    unit = str(properties.get(STEP_UNIT, ""))
    scale = TIME_UNITS.get(normalize_time_unit(unit or "s"), math.nan)
    rate = _read_number(properties, RATE, round_rate(scale * _read_number(properties, STEP)))
    if math.isnan(rate):  # not written as a waveform: some say it in their own words
        stated = [NamedArray(name, np.asarray(value)) for name, value in properties.items()]
        rate = next((rate for rate in map(read_stated_rate, stated) if rate > 0), math.nan)
    return NamedArray(
        name=name,
        values=np.asarray(channel[:]) if len(channel) else np.empty(0),
        stated={
            "sampling_rate": rate,
            "unit": str(properties.get(UNIT, "")),
            "start": scale * _read_number(properties, START, 0.0) if scale > 0 else 0.0,
            "time_flaw": None
            if scale > 0
            else f"{path}: the steps of {name!r} are in {unit!r}, no unit of time: if it is a"
            " trace over time, give --rate",
            "recorded_at": _read_time(properties),
            ORIGIN: str(properties.get(ORIGIN, "")),
        },
        is_channel=RATE in properties or rate > 0,
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


@contextlib.contextmanager
def _refuse_doubtful() -> Iterator[list[str]]:
    """Make errors of what npTDMS would print: lengths that contradict each other, odd scales.

    Yields what is no error: that the file is cut at its end, as when a program was ended.
    """
    from nptdms.log import log_manager

    remarks: list[str] = []

    def refuse(record: logging.LogRecord) -> None:
        if str(record.msg).startswith(CUT):
            remarks.append("the file is cut at its end: its channels end early")
        if remarks and str(record.msg).startswith((CUT, ODD_REST)):
            return
        raise ValueError(record.getMessage())

    console: Any = log_manager.console_handler
    console.emit = refuse
    try:
        yield remarks
    finally:
        del console.emit


def write_tdms(path: Path, measurement: Measurement) -> None:
    """Write channels as waveforms of one group."""
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
        if channel.origin:
            properties[ORIGIN] = channel.origin
        if channel.recorded_at:
            properties[RECORDED_AT] = _make_time(channel.recorded_at)
        if name != channel.name:
            properties[NAME] = channel.name
        objects.append(ChannelObject("traces", name, channel.values, properties))
    with TdmsWriter(str(path)) as writer:
        writer.write_segment(objects)
