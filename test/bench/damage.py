"""Reads spoilt files, one after the other, with bounded memory; a process of its own.

Called with a folder that holds the good recordings or other files, the first seed and how many.
Prints a line of JSON before and after each spoilt file, so that the last line shows what hung.
"""

import json
import random
import resource
import shutil
import struct
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

from impact_rig.analysis.analyze import analyze as analyze_source
from impact_rig.analysis.measured_files import MeasuredFiles, make_series
from impact_rig.configuration.rig_file import read_rig_file
from impact_rig.core.errors import RigError
from impact_rig.core.session import Session
from impact_rig.core.setup import RigSetup
from impact_rig.recordings.contents import inspect_recording
from impact_rig.recordings.reader import read_recording
from impact_rig.recordings.scan import MAGIC
from impact_rig.recordings.source import SUFFIX
from impact_rig.results.results_file import read_results

_FRAME = struct.Struct("<BQ")
"""Kind and length of an MCAP record."""
_MAGIC_SIZE = 8
"""Of the bytes that the file begins with [byte]."""
_CHUNK = 6
"""Kind of a record that holds others."""
_CHUNK_CHECKSUM, _CHUNK_NAME, _CHUNK_DATA = 24, 28, 40
"""Where a chunk has its checksum, the length of its compression's name, and its data if that is
empty, from the start of its content [byte]."""
_LENGTHS = (0, 1, 0xFF, 0xFFFF, 1 << 31, 0xFFFFFFFF, 10 << 30, 1 << 62, (1 << 64) - 1)
"""What a length may be made: nothing, borders of number types, 10 GB, and beyond every file."""
MAX_FLIPS = 20  # bits flipped at once
MAX_SPLICE = 5000  # bytes moved at once


def mutate(data: bytes, seed: int) -> bytes:
    """Return a spoilt copy of a file.

    Parameters
    ----------
    data : bytes
        Of any file. Of MCAP best an uncompressed one too, so that lengths inside of messages are
        hit.
    seed : int
        The same one spoils the same bytes.
    """
    dice = random.Random(seed)
    spoilt = bytearray(data)
    is_recording = data.startswith(MAGIC)
    # Behind checksums hardly any damage would reach the messages.
    if is_recording and dice.random() < 0.5:
        _drop_checksums(spoilt)
    ways = (*_WAYS, _change_record_length) if is_recording else _WAYS
    for _ in range(dice.choice((1, 1, 1, 2, 3))):
        if spoilt:
            dice.choice(ways)(spoilt, dice)
    return bytes(spoilt)


def _drop_checksums(data: bytearray) -> None:
    for kind, start, end in list(_find_records(data)):
        if kind == _CHUNK and end - start >= _CHUNK_NAME:
            data[start + _CHUNK_CHECKSUM : start + _CHUNK_NAME] = bytes(4)


def _flip_bits(data: bytearray, dice: random.Random) -> None:
    for _ in range(dice.randint(1, MAX_FLIPS)):
        data[dice.randrange(len(data))] ^= 1 << dice.randrange(8)


def _cut_off(data: bytearray, dice: random.Random) -> None:
    del data[dice.randrange(len(data)) :]


def _remove_bytes(data: bytearray, dice: random.Random) -> None:
    start = dice.randrange(len(data))
    del data[start : start + dice.randint(1, MAX_SPLICE)]


def _overwrite_with_noise(data: bytearray, dice: random.Random) -> None:
    start = dice.randrange(len(data))
    size = min(dice.randint(1, MAX_SPLICE), len(data) - start)
    data[start : start + size] = dice.randbytes(size)


def _change_record_length(data: bytearray, dice: random.Random) -> None:
    kind, start, end = _choose_record(data, dice)
    length = dice.choice((*_LENGTHS, end - start + 1, max(end - start - 1, 0)))
    data[start - _FRAME.size : start] = _FRAME.pack(kind, length)


def _write_number(data: bytearray, dice: random.Random) -> None:
    """Overwrite what may be a size, near the beginning by preference: binary, or as digits."""
    size = dice.choice((2, 4, 8))
    place = dice.randrange(max(min(len(data), dice.choice((200, 2000, len(data)))) - size, 1))
    number = dice.choice(_LENGTHS) % (1 << 8 * size)
    is_text = dice.random() < 0.3
    data[place : place + size] = (
        str(number).encode("ascii") if is_text else number.to_bytes(size, dice.choice(_ORDERS))
    )


def _repeat_bytes(data: bytearray, dice: random.Random) -> None:
    """Nest deeper, count higher, or go on: a few bytes a thousand times."""
    start = dice.randrange(len(data))
    part = data[start : start + dice.randint(1, 20)]
    data[start:start] = part * dice.choice((2, 50, 1000, 5000))


_ORDERS: tuple[Literal["little", "big"], ...] = ("little", "big")
_WAYS: tuple[Callable[[bytearray, random.Random], None], ...] = (
    _flip_bits,
    _cut_off,
    _remove_bytes,
    _overwrite_with_noise,
    _write_number,
    _repeat_bytes,
)


def _find_records(data: bytearray) -> Iterator[tuple[int, int, int]]:
    """Yield kind, start and end of the content of each record, also in uncompressed chunks."""
    yield from _find_records_between(data, _MAGIC_SIZE, len(data))


def _find_records_between(data: bytearray, place: int, end: int) -> Iterator[tuple[int, int, int]]:
    while place + _FRAME.size <= end:
        kind, length = _FRAME.unpack_from(data, place)
        start, place = place + _FRAME.size, place + _FRAME.size + length
        if place > end:
            return
        yield kind, start, place
        is_plain = data[start + _CHUNK_NAME : start + _CHUNK_NAME + 4] == bytes(4)
        if kind == _CHUNK and is_plain:
            yield from _find_records_between(data, start + _CHUNK_DATA, place)


def _choose_record(data: bytearray, dice: random.Random) -> tuple[int, int, int]:
    """Return kind, start and end of a record; of all bytes where there is none any more."""
    records = list(_find_records(data))
    return dice.choice(records) if records else (0, min(_FRAME.size, len(data)), len(data))


MEMORY_LIMIT = 500 << 20  # [byte], for reading: a thousand times the spoilt recordings


def analyze(path: Path) -> None:
    """Find and judge the hits; what is estimated from them afterwards knows no files."""
    session: Session | None = None
    for event in read_recording(path).events():
        if isinstance(event, RigSetup):
            session = Session(event)
        elif session is not None:
            session.feed(event)


def analyze_file(path: Path) -> None:
    """Read a file of another instrument, and estimate from it."""
    files = MeasuredFiles([path], SERIES)
    if not files.hits:
        raise RigError(files.errors[0])
    analyze_source(files)


SERIES = make_series(
    {"hammer_mass": 0.5, "sample_mass": 1.0, "hammer_unit": "m/s^2", "cutoff": 0.0},
)
"""What is stated of all files."""


def choose_operations(suffix: str) -> dict[str, Callable[[Path], object]]:
    """Return the ways of reading a file, by their names."""
    if suffix == SUFFIX:
        return {"analyze": analyze, "info": inspect_recording}
    others = {".json": read_results, ".toml": read_rig_file}
    return {suffix: others.get(suffix, analyze_file)}


def try_operation(operation: Callable[[Path], object], path: Path) -> str:
    """Return how it ended: "read", "refused" in one sentence, "no memory", or the fault."""
    try:
        operation(path)
    except RigError:
        return "refused"
    except MemoryError:
        return "no memory"
    except Exception as error:  # noqa: BLE001 - whatever it is, it is what the bench looks for
        return f"{type(error).__name__}: {error}"[:300]
    return "read"


def limit_memory() -> None:
    """Let this process have `MEMORY_LIMIT` more than it has, and no more."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
    limit = pages * resource.getpagesize() + MEMORY_LIMIT
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def main(folder: str, first: str, count: str) -> None:
    """Spoil and read."""
    originals = [(path.suffix, path.read_bytes()) for path in sorted(Path(folder).glob("*.*"))]
    work = Path(folder, "work")
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    limit_memory()
    for seed in range(int(first), int(first) + int(count)):
        print(json.dumps({"seed": seed}), flush=True)
        suffix, data = originals[seed % len(originals)]
        path = work / f"spoilt{suffix}"
        path.write_bytes(mutate(data, seed))
        operations = choose_operations(suffix)
        outcomes = {name: try_operation(operate, path) for name, operate in operations.items()}
        print(json.dumps({"seed": seed, "outcomes": outcomes}), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
