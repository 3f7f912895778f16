"""Sound files (`.wav`), as recorders with sensor inputs write them."""

import io
import struct
from pathlib import Path

from impact_rig.core.given.errors import FileError
from impact_rig.files.measurement import MeasuredChannel, Measurement, keep_values

BYTE_ORDERS = {b"RIFF": "<", b"RIFX": ">", b"RF64": "<"}
CHUNK_HEADER = 8
"""Name and size of a chunk [byte]."""
CUE_COUNT, CUE_SIZE, CUE_POINT = 4, 24, 20
"""In a chunk of cues: size of the count, size of each cue, place of its point in it [byte]."""


def read_wav(path: Path) -> Measurement:
    """Read the channels of a sound file; integers stay the counts that they are.

    Raises
    ------
    FileError
        If the file is no sound file of numbers, or is cut off.
    """
    from scipy.io import wavfile

    data = path.read_bytes()
    order = BYTE_ORDERS.get(data[:4])
    if order is None or data[8:12] != b"WAVE":
        raise FileError(f"{path} is no .wav file: it should begin with RIFF and WAVE")
    chunks = _find_chunks(path, data, order)
    if not {b"fmt ", b"data"} <= chunks.keys():
        raise FileError(f"{path} is cut off: it holds no sound")
    channel_count, _, _, block = struct.unpack_from(f"{order}HIIH", chunks[b"fmt "], 2)
    # From memory, where a size in the header that is too large takes none.
    rate, array = wavfile.read(io.BytesIO(data))
    spare = array.dtype.itemsize - block // channel_count
    if array.dtype.kind == "i" and spare > 0:
        array = array >> 8 * spare  # 24 bits come shifted up
    columns = [array] if channel_count == 1 else list(array.T)
    channels = (
        MeasuredChannel(f"channel {number}", keep_values(column, f"{path}"), float(rate))
        for number, column in enumerate(columns, start=1)
    )
    cues = _read_cues(chunks.get(b"cue ", b""), order)
    return Measurement(path, tuple(channels), tuple(cue for cue in cues if cue < len(array)))


def _find_chunks(path: Path, data: bytes, order: str) -> dict[bytes, memoryview]:
    """Return the chunks by their names; refuse a file that is shorter than its sound."""
    chunks: dict[bytes, memoryview] = {}
    position = 12
    while position + CHUNK_HEADER <= len(data):
        name, size = struct.unpack_from(f"{order}4sI", data, position)
        position += CHUNK_HEADER
        left = len(data) - position
        if name == b"data" and size > left and data[:4] != b"RF64":
            raise FileError(
                f"{path} is cut off: it should have {size} bytes of sound, it has {left}"
            )
        chunks.setdefault(name, memoryview(data)[position : position + size])
        position += size + size % 2
    return chunks


def _read_cues(chunk: bytes | memoryview, order: str) -> list[int]:
    """Return the points that cues mark, in their order."""
    places = range(CUE_COUNT + CUE_POINT, len(chunk) - 3, CUE_SIZE)
    return sorted({struct.unpack_from(f"{order}I", chunk, place)[0] for place in places})
