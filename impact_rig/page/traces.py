"""A hit's traces for a screen: of the points in a column of pixels the least and the largest."""

import json
import math
import struct
from collections.abc import Sequence

import numpy as np

from impact_rig.core.given.records import FloatArray
from impact_rig.results.traces import AlignedHit, Float32Array, JudgedTraces

COLUMNS = 700
"""Columns of pixels in a picture [-]: a wall screen shows no more in its middle."""
MARGIN = 1.5
"""Extent of the second picture before and after the middle of the pulse [contact times]."""
NAMES = ("hammer", "sample")


def pack_traces(traces: JudgedTraces, levels: Sequence[tuple[str, float]] = ()) -> bytes:
    """Return a hit's traces as the page takes them: the length of a header, the header, columns.

    The header is JSON, padded to four bytes. Each picture, the whole record and the contact, has
    for each channel the least and the largest value of every column, as float32.

    Parameters
    ----------
    levels : sequence
        Of the hammer, by name [m/s^2].
    """
    hit = traces.aligned
    windows = [("whole", -math.inf, math.inf)]
    if math.isfinite(traces.contact_time):
        margin = MARGIN * traces.contact_time
        windows.append(("contact", -margin, margin))
    pictures = [(name, *_reduce(hit, begin, end)) for name, begin, end in windows]
    header = {
        "record": hit.label.record,
        "sample": hit.label.sample,
        "accepted": traces.accepted,
        "channels": [
            _describe_channel(name, channel, levels if name == "hammer" else ())
            for name, channel in zip(NAMES, hit.traces, strict=False)
        ],
        "views": [
            {"name": name, "columns": columns.shape[1] // 2, "axis": axis}
            for name, columns, axis in pictures
        ],
    }
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    columns = b"".join(values.tobytes() for _, values, _ in pictures)
    return struct.pack("<I", len(text)) + text + columns


def integrate_hammer(traces: JudgedTraces) -> float:
    """Return by how much the hammer's speed changes in the contact [m/s]; NaN: not determined."""
    hit, reach = traces.aligned, traces.contact_time
    inside = np.abs(hit.time) < reach  # twice as long as the contact
    if not inside.any():
        return math.nan
    return abs(float(hit.traces[0, inside].sum())) / hit.sampling_rate


def _describe_channel(
    name: str, channel: FloatArray, levels: Sequence[tuple[str, float]]
) -> dict[str, object]:
    low, high = float(channel.min()), float(channel.max())
    return {
        "name": name,
        "peak": f"{max(-low, high):.0f} m/s²",
        "range": [low, high if high > low else low + 1.0],
        "lines": [
            {"name": text, "value": math.copysign(level, high + low)} for text, level in levels
        ],
    }


def _reduce(hit: AlignedHit, begin: float, end: float) -> tuple[Float32Array, str]:
    """Return least and largest of each column, shape (channels, 2 columns), and their times."""
    time = hit.time
    first, stop = np.searchsorted(time, (begin, end)).tolist()
    first = min(first, len(time) - 1)
    shown = hit.traces[:, first : max(stop, first + 1)]
    starts = np.unique(np.linspace(0, shown.shape[1], COLUMNS, endpoint=False).astype(int))
    least = np.minimum.reduceat(shown, starts, axis=1)
    largest = np.maximum.reduceat(shown, starts, axis=1)
    pairs = np.stack((least, largest), axis=2).reshape(len(shown), -1).astype("<f4")
    last = first + shown.shape[1] - 1
    return pairs, f"{time[first] * 1e3:.2f} to {time[last] * 1e3:.2f} ms"
