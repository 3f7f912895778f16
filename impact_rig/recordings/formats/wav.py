"""Sound files (`.wav`), as recorders with sensor inputs write them."""

import io
import struct
from pathlib import Path
from typing import NamedTuple

from impact_rig.core.errors import FileError
from impact_rig.recordings.formats.measurement import (
    MeasuredChannel,
    Measurement,
    keep_values,
)

BYTE_ORDERS = {b"RIFF": "<", b"RIFX": ">", b"RF64": "<"}
CHUNK_HEADER = 8
"""Name and size of a chunk [byte]."""


class _Layout(NamedTuple):
    """Channels, and bytes that one number of a channel takes."""

    channels: int
    width: int


def read_wav(path: Path) -> Measurement:
    """Read the channels of a sound file; integers stay the counts that they are.

    Raises
    ------
    FileError
        If the file is no sound file of numbers, or is cut off.
    """
    from scipy.io import wavfile

    data = path.read_bytes()
    layout = _check_chunks(path, data)
    # From memory, where a size in the header that is too large takes none.
    rate, array = wavfile.read(io.BytesIO(data))
    if array.dtype.kind == "i" and array.dtype.itemsize > layout.width:
        array = array >> 8 * (array.dtype.itemsize - layout.width)  # 24 bits come shifted up
    columns = [array] if layout.channels == 1 else list(array.T)
    return Measurement(
        path,
        tuple(
            MeasuredChannel(f"channel {number}", keep_values(column, f"{path}"), float(rate))
            for number, column in enumerate(columns, start=1)
        ),
    )


def _check_chunks(path: Path, data: bytes) -> _Layout:
    """Return how numbers are laid out; refuse a file that is shorter than it claims to be."""
    order = BYTE_ORDERS.get(data[:4])
    if order is None or data[8:12] != b"WAVE":
        raise FileError(f"{path} is no .wav file: it should begin with RIFF and WAVE")
    layout = None
    position = 12
    while position + CHUNK_HEADER <= len(data):
        name, size = struct.unpack_from(f"{order}4sI", data, position)
        position += CHUNK_HEADER
        if name == b"fmt ":
            channels, _, _, block = struct.unpack_from(f"{order}HIIH", data, position + 2)
            layout = _Layout(channels, block // channels)
        if name == b"data" and layout is not None:
            left = len(data) - position
            if size > left and data[:4] != b"RF64":
                raise FileError(
                    f"{path} is cut off: it should have {size} bytes of sound, it has {left}"
                )
            return layout
        position += size + size % 2
    raise FileError(f"{path} is cut off: it holds no sound")
