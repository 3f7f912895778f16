"""Rows that are not the points of one trace: records in turn, values held, an envelope."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.given.records import RawArray
from impact_rig.files.measurement import Measurement
from impact_rig.files.plan import ChannelPlan
from impact_rig.files.times import Axis, find_axis, is_clock, read_clock, split_points

MINIMUM_POINTS = 16  # of a trace: a pulse and some baseline
LEAST_JUMP = 3.0
"""Median change from value to value over the smallest [-], our choice: below it values are held
since they are counts."""


def split_measurement(measurement: Measurement, plan: ChannelPlan) -> Measurement:
    """Return a measurement whose records, one below the other, are channels of their own.

    Each has the sampling rate of its times, which begin anew at each record.
    """
    time = measurement.channels[0]
    if plan.columns is not None or time.flaw or find_axis(time.name, time.unit) is not Axis.TIME:
        return measurement
    records = _split_records(time.values)
    if len(records) == 1:
        return measurement
    clocks = [
        read_clock(measurement.path, time.name, time.values[it], time.unit) for it in records
    ]
    channels = tuple(
        replace(
            channel,
            name=f"{channel.name} (segment {number})",
            values=channel.values[record],
            **clock.stated,
        )
        for number, (record, clock) in enumerate(zip(records, clocks, strict=True), start=1)
        for channel in measurement.channels[1:]
        if channel.values.size == time.values.size
    )
    told = f"its times begin anew {len(records) - 1} times: each record is a hit of its own"
    remarks = (*measurement.remarks, told)
    return replace(measurement, channels=channels, remarks=remarks)


def _split_records(times: RawArray) -> list[slice]:
    """Return the points of each record, where times begin anew at each: one slice, if they do not.

    Every record goes on in even steps for `MINIMUM_POINTS` at least.
    """
    falls = np.flatnonzero(np.diff(times) < 0.0) + 1
    ends = [0, *falls.tolist(), times.size]
    records = [slice(*pair) for pair in pairwise(ends)]
    sizes = [record.stop - record.start for record in records]
    are_traces = min(sizes) >= MINIMUM_POINTS and all(is_clock(times[it]) for it in records)
    return records if are_traces else [slice(0, times.size)]


def find_hold(values: RawArray) -> tuple[int, int]:
    """Return where values begin to be held, and for how many points: 1, not; 0, not equally long.

    A staircase of single counts is no held value: its steps are all as small as can be.
    """
    changes: list[NDArray[np.intp]] = []
    for first, piece in split_points(values):
        found = np.flatnonzero(np.diff(piece)) + first + 1
        if np.diff(found).min(initial=2) < 2:  # noqa: PLR2004 - the next point is another
            return 0, 1
        changes.append(found)
    places = np.concatenate(changes)
    if places.size < MINIMUM_POINTS:
        return 0, 1
    runs = np.diff(places)
    times = int(np.gcd.reduce(runs))
    if times > 1:
        return int(places[0]) % times, times
    jumps = np.abs(np.diff(values.astype(np.float64))[places - 1])
    is_staircase = np.median(jumps) < LEAST_JUMP * jumps.min()
    return 0, int(is_staircase)


def is_envelope(times: RawArray, values: RawArray) -> bool:
    """Return whether each time stands twice, beside a minimum and a maximum."""
    size = values.size // 2 * 2
    if not np.array_equal(times[:size:2], times[1:size:2]):
        return False
    rises = np.diff(values[:size].reshape(-1, 2), axis=1)
    return bool(np.all(rises >= 0.0) or np.all(rises <= 0.0))
