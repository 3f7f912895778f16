"""Damaged files of every format, read one after the other by a process with bounded memory.

As a program it is called with the folder of the good files, the first seed and how many. It prints
a line of JSON before and after each damaged file, so that the last line shows what ended it.
"""

import faulthandler
import json
import random
import resource
import shutil
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import mcap.writer
import numpy as np
import openpyxl
from scipy.io import wavfile

from bench.measure import Bench, Figure
from impact_rig.analysis.analyze import analyze as analyze_source
from impact_rig.analysis.measured_files import MeasuredFiles, make_series
from impact_rig.configuration.rig_file import read_rig_file, read_template
from impact_rig.core.estimates.paper_method import HammerEstimate
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.errors import RigError
from impact_rig.core.given.records import FloatArray, HitLabel
from impact_rig.core.given.setup import PAPER_SETUP, RigSetup
from impact_rig.core.session import Session
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.files.formats.registry import WRITABLE, write_measurement
from impact_rig.files.import_file import MeasurementOptions
from impact_rig.files.measurement import MeasuredChannel, Measurement
from impact_rig.recordings.contents import inspect_run
from impact_rig.recordings.messages import MessageEncoder
from impact_rig.recordings.records import OfferedQos
from impact_rig.recordings.run import Run
from impact_rig.recordings.scan import MAGIC
from impact_rig.recordings.source import SUFFIX
from impact_rig.recordings.writer import RecordingWriter
from impact_rig.results.campaign import Results
from impact_rig.results.results_file import read_results, write_results

TIME = 1_700_000_000_000_000_000  # [ns], of what is recorded
TIME_LIMIT = 30.0  # [s], for one damaged file: a hundred times as long as a good one
MEMORY_LIMIT = 500 << 20  # [byte], for reading: a thousand times the damaged recordings
DATA = Path(__file__).parents[1] / "data" / "repeat_shock"


def measure_fuzz(bench: Bench) -> Iterator[Figure]:
    """Damage small files of every format, and read them in every way that there is."""
    recordings, others = bench.folder / "recordings", bench.folder / "others"
    recordings.mkdir()
    others.mkdir()
    for compression in ("zstd", "lz4", "none"):
        write_recording(recordings / f"{compression}.mcap", compression)
    total = bench.extent.mutations
    number = total * write_files(others)
    faults = [
        *read_damaged(recordings, bench.extent.seed, total),
        *read_damaged(others, bench.extent.seed, number),
    ]
    note = f"of {total + number}; {'; '.join(faults[:3])}"
    yield Figure("damaged files that hang or crash", len(faults), note=note, most=0)


def write_recording(path: Path, compression: str) -> None:
    """Write a recording of two hits."""
    encoder, rig = MessageEncoder(), VirtualRig(PAPER_SETUP, VirtualRigSettings())
    with RecordingWriter(path, compression=compression) as writer:
        channel = writer.add_channel("/setup", encoder.setup_definition, (OfferedQos(),))
        writer.add_message(channel, encoder.encode_setup(PAPER_SETUP, TIME), TIME, TIME)
        channel = writer.add_channel("/acceleration", encoder.block_definition, (OfferedQos(),))
        for record in (1, 2):
            for block in rig.strike(HitLabel("steel large", record, record)).split(1000, 0):
                writer.add_message(channel, encoder.encode_block(block), TIME, TIME)


def write_files(folder: Path) -> int:
    """Write a good file of each format; return how many."""
    trace = np.sin(np.arange(2000) / 100) * np.exp(-((np.arange(2000) - 500) ** 2) / 2e3)
    channels = [MeasuredChannel(name, trace, 51_200.0, "m/s^2") for name in ("hammer", "sample")]
    for suffix in WRITABLE:
        write_measurement(folder / f"a{suffix}", Measurement(folder, tuple(channels)))
    np.save(folder / "a.npy", np.stack([np.arange(2000) / 51_200, trace, trace]))
    np.savez_compressed(folder / "a.npz", hammer=trace, dt=1 / 51_200)
    wavfile.write(folder / "a.wav", 51_200, (2e4 * trace).astype(np.int16))
    shutil.copy(DATA / "Test_001_shock.lvm", folder / "a.lvm")
    rows = "\n".join(f"{number / 51_200}\t{value}" for number, value in enumerate(trace))
    (folder / "a.txt").write_text(f"Time (s)\tHammer (m/s^2)\n{rows}\n", "utf-8")
    results = Results(PAPER_SETUP, HammerEstimate(), (SampleEstimate("steel small", 3, 1),), ())
    write_results(folder / "a.json", results)
    (folder / "a.toml").write_text(read_template(), "utf-8")
    for scope in ("agilent.bin", "lecroy.trc", "tektronix.wfm"):
        shutil.copy(DATA.parent / "scopes" / scope, folder)
    book = openpyxl.Workbook()
    for number, value in enumerate(trace[:500]):
        book.active.append([number / 51_200, value])
    book.save(folder / "a.xlsx")
    write_bag(folder / "a.mcap", trace)
    return len(list(folder.iterdir()))


def write_bag(path: Path, trace: FloatArray) -> None:
    """Write a recording of other nodes: a vector in ROS's own encoding, a number in JSON."""
    text = "geometry_msgs/Vector3 force\n" + "=" * 80 + "\nMSG: geometry_msgs/Vector3\n"
    text += "float64 x\nfloat64 y\nfloat64 z\n"
    with path.open("wb") as file:
        writer = mcap.writer.Writer(file)
        writer.start("ros2")
        schema = writer.register_schema("lab_msgs/msg/Force", "ros2msg", text.encode())
        vector = writer.register_channel("/tip", "cdr", schema)
        schema = writer.register_schema("Force", "jsonschema", b"{}")
        number = writer.register_channel("/force", "json", schema)
        for at, value in enumerate(trace[:500]):
            time = TIME + at * 1_000_000
            data = struct.pack("<4x3d", value, 0.0, -value)
            writer.add_message(vector, time, b"\0\1" + data[2:], time)
            writer.add_message(number, time, json.dumps({"force": value}).encode(), time)
        writer.finish()


def read_damaged(folder: Path, first: int, total: int) -> list[str]:
    """Read damaged files until all are read; return what must not happen, by its seed."""
    faults: list[str] = []
    seed, end = first, first + total
    while seed < end:
        command = [sys.executable, "-m", "bench.damage", str(folder), str(seed), str(end - seed)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        reason = f"code {done.returncode}, {' '.join(done.stderr.split()[:20])}"
        lines = [json.loads(line) for line in done.stdout.splitlines()]
        if not lines:
            raise RigError(f"the process that reads damaged files cannot be run: {reason}")
        faults += [f"seed {line['seed']}, {line['fault']}" for line in lines if line.get("fault")]
        seed = lines[-1]["seed"] + 1
        if "fault" not in lines[-1]:
            faults.append(f"seed {lines[-1]['seed']}: {reason}")
    return faults


def main(folder: str, first: str, count: str) -> None:
    """Damage and read; a file that takes too long ends the process."""
    paths = sorted(Path(folder).glob("*.*"))
    originals = [(path.suffix, path.read_bytes()) for path in paths]
    work = Path(folder, "work")
    work.mkdir(exist_ok=True)
    for path in paths:  # the libraries are loaded now: their size does not count
        for read in choose_ways(path.suffix):
            try_to_read(read, path)
    limit_memory()
    for seed in range(int(first), int(first) + int(count)):
        print(json.dumps({"seed": seed}), flush=True)
        suffix, data = originals[seed % len(originals)]
        path = work / f"damaged{suffix}"
        path.write_bytes(mutate(data, seed))
        faulthandler.dump_traceback_later(TIME_LIMIT, exit=True)
        faults = [try_to_read(read, path) for read in choose_ways(suffix)]
        print(json.dumps({"seed": seed, "fault": "; ".join(filter(None, faults))}), flush=True)


def limit_memory() -> None:
    """Let this process have `MEMORY_LIMIT` more than it has, and no more."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
    limit = pages * resource.getpagesize() + MEMORY_LIMIT
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def try_to_read(read: Callable[[Path], object], path: Path) -> str | None:
    """Return what must not happen; None: the file is read, or refused in a sentence."""
    try:
        read(path)
    except RigError:
        pass
    except Exception as error:  # noqa: BLE001 - whatever it is, it is what the bench looks for
        return f"{type(error).__name__}: {error}"[:300]
    return None


def choose_ways(suffix: str) -> list[Callable[[Path], object]]:
    """Return the ways of reading a file."""
    if suffix == SUFFIX:
        return [judge_recording, lambda path: inspect_run(Run(path)), analyze_file]
    return [{".json": read_results, ".toml": read_rig_file}.get(suffix, analyze_file)]


def judge_recording(path: Path) -> None:
    """Find and judge the hits; what is estimated from them afterwards knows no files."""
    session: Session | None = None
    for event in Run(path).events():
        if isinstance(event, RigSetup):
            session = Session(event)
        elif session is not None:
            session.feed(event)


SERIES = make_series(
    MeasurementOptions(hammer_mass=0.5, sample_mass=1.0, hammer_unit="m/s^2", cutoff=0.0)
)
"""What is stated of all files."""


def analyze_file(path: Path) -> None:
    """Read a file of another instrument, and estimate from it."""
    files = MeasuredFiles([path], SERIES)
    if not files.hits:
        raise RigError(files.errors[0])
    analyze_source(files)


SIZES = (0, 1, 0xFF, 0xFFFF, 1 << 31, 0xFFFFFFFF, 10 << 30, 1 << 62, (1 << 64) - 1)
"""What a size may be made: nothing, borders of number types, 10 GB, and beyond every file."""
FRAME = struct.Struct("<BQ")  # kind and length of an MCAP record
CHUNK = 6  # kind of a record that holds others
CHUNK_CHECKSUM = 24  # where its content has the four bytes


def mutate(data: bytes, seed: int) -> bytes:
    """Return a damaged copy of a file; the same seed damages the same bytes."""
    dice = random.Random(seed)
    damaged = bytearray(data)
    ways = [flip_bits, cut_off, remove_bytes, overwrite_with_noise, write_size, repeat_bytes]
    # Behind checksums hardly any damage would reach the messages.
    if data.startswith(MAGIC) and dice.random() < 0.5:
        drop_checksums(damaged)
    for _ in range(dice.choice((1, 1, 1, 2, 3))):
        if damaged:
            dice.choice(ways)(damaged, dice)
    return bytes(damaged)


def flip_bits(data: bytearray, dice: random.Random) -> None:
    """Flip up to 20 bits."""
    for _ in range(dice.randint(1, 20)):
        data[dice.randrange(len(data))] ^= 1 << dice.randrange(8)


def cut_off(data: bytearray, dice: random.Random) -> None:
    """End the file at any byte."""
    del data[dice.randrange(len(data)) :]


def remove_bytes(data: bytearray, dice: random.Random) -> None:
    """Take up to 5000 bytes out."""
    start = dice.randrange(len(data))
    del data[start : start + dice.randint(1, 5000)]


def overwrite_with_noise(data: bytearray, dice: random.Random) -> None:
    """Overwrite up to 5000 bytes."""
    start = dice.randrange(len(data))
    size = min(dice.randint(1, 5000), len(data) - start)
    data[start : start + size] = dice.randbytes(size)


def write_size(data: bytearray, dice: random.Random) -> None:
    """Overwrite what may be a size, near the beginning by preference: binary, or as digits."""
    width = dice.choice((2, 4, 8))
    place = dice.randrange(max(min(len(data), dice.choice((200, 2000, len(data)))) - width, 1))
    number = dice.choice(SIZES) % (1 << 8 * width)
    if dice.random() < 0.3:
        data[place : place + width] = str(number).encode("ascii")
    else:
        data[place : place + width] = number.to_bytes(width, dice.choice(("little", "big")))


def repeat_bytes(data: bytearray, dice: random.Random) -> None:
    """Nest deeper, count higher, or go on: a few bytes up to 5000 times."""
    start = dice.randrange(len(data))
    few = data[start : start + dice.randint(1, 20)]
    data[start:start] = few * dice.choice((2, 50, 1000, 5000))


def drop_checksums(data: bytearray) -> None:
    """Take the checksums of all chunks of an MCAP file away."""
    place = len(MAGIC)
    while place + FRAME.size <= len(data):
        kind, length = FRAME.unpack_from(data, place)
        place += FRAME.size
        if kind == CHUNK:
            data[place + CHUNK_CHECKSUM : place + CHUNK_CHECKSUM + 4] = bytes(4)
        place += length


if __name__ == "__main__":
    main(*sys.argv[1:])
