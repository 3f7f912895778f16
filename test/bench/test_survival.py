"""The parts `fuzz` and `kill`, on little, and the damage that is made from a seed."""

import json
import math
import random
import struct
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from bench import damage, survival
from bench.damage import mutate
from impact_rig.core.errors import FileError


@pytest.fixture
def plain(tmp_path):
    path = tmp_path / "file.mcap"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=200, compression=CompressionType.NONE)
        writer.start("ros2", "test")
        schema = writer.register_schema("a/msg/B", "ros2msg", b"uint8 x")
        channel = writer.register_channel("/b", "cdr", schema)
        for number in range(20):
            writer.add_message(channel, number, bytes([number]) * 50, number)
        writer.finish()
    return path.read_bytes()


def test_seeds_give_different_damage(plain):
    spoilt = {mutate(plain, seed) for seed in range(200)}
    assert len(spoilt) > 190
    assert plain not in spoilt


@pytest.mark.parametrize("way", damage._WAYS, ids=lambda way: way.__name__)
def test_every_way_changes_a_recording_and_bears_any_other_bytes(plain, way):
    changed = 0
    for seed in range(20):
        spoilt = bytearray(plain)
        way(spoilt, random.Random(seed))
        changed += spoilt != plain
    assert changed > 10
    for other in (b"x", bytes(8), bytes(30), b"\x89MCAP0\r\n\x06" + b"\xff" * 20):
        way(bytearray(other), random.Random(1))


def test_damaged_recordings_are_all_read_in_all_ways(bench, tmp_path):
    (tmp_path / "count").mkdir()
    few = replace(bench, extent=replace(bench.extent, mutations=2))
    faults, number, _, *ways, memory = survival.measure_fuzz(few)
    assert faults.values == (0.0,)
    assert number.values == (2.0,)
    formats = survival.write_files(tmp_path / "count")
    assert sum(figure.values[0] for figure in ways) == 2 * (len(damage.OPERATIONS) + formats)
    assert memory.values[0] < 2000


@pytest.mark.parametrize(
    ("error", "outcome"),
    [
        (None, "read"),
        (FileError("damaged"), "refused"),
        (MemoryError(), "no memory"),
        (struct.error("unpack"), "error: unpack"),
    ],
)
def test_what_is_no_refusal_in_words_is_a_fault(error, outcome):
    def operate(_):
        if error is not None:
            raise error

    assert damage.try_operation(operate, Path()) == outcome


PROCESS = """\
import json, os, sys, time
first, count = map(int, sys.argv[-2:])
for seed in range(first, first + count):
    print(json.dumps({{"seed": seed}}), flush=True)
    if seed == 3:
        {fault}
    print(json.dumps({{"seed": seed, "outcomes": {{"read": "read"}}, "peak_kib": 1}}), flush=True)
"""


@pytest.mark.parametrize(
    ("fault", "words"), [("os.abort()", "ended by itself"), ("time.sleep(60)", "no end within")]
)
def test_a_crash_and_a_hang_are_told_by_their_seed_and_the_rest_is_read(
    bench, monkeypatch, tmp_path, fault, words
):
    (tmp_path / "process.py").write_text(PROCESS.format(fault=fault))
    start = survival.subprocess.Popen

    def start_other(command, **options):
        return start([sys.executable, tmp_path / "process.py", *command[-2:]], **options)

    monkeypatch.setattr(survival.subprocess, "Popen", start_other)
    monkeypatch.setattr(survival, "TIME_LIMIT", 2.0)
    monkeypatch.setattr(survival, "write_files", lambda _: 0)
    faults, _, _, reads, _ = survival.measure_fuzz(bench)
    assert faults.values == (1.0,)
    assert faults.note.startswith("seed 3: ")
    assert words in faults.note
    assert reads.values == (5.0,)


def test_the_verdicts_of_a_killed_recording_are_those_of_its_whole_hits(recording, tmp_path):
    whole = survival.recover_verdicts(recording)
    assert list(whole) == [1, 2, 3]
    content = recording.read_bytes()
    with recording.open("rb") as file:
        last = make_reader(file).get_summary().chunk_indexes[-1]
    cut = tmp_path / "session.mcap"
    cut.write_bytes(content[: last.chunk_start_offset + 100])
    found = survival.recover_verdicts(cut)
    assert list(found) == [1, 2]
    assert all(verdict.is_same(whole[record]) for record, verdict in found.items())
    cut.write_bytes(b"")
    assert survival.recover_verdicts(cut) == {}


@pytest.mark.parametrize(
    ("other", "is_same"),
    [
        (survival.Verdict(True, 2e-4), True),
        (survival.Verdict(True, math.nextafter(2e-4, 1.0)), False),
        (survival.Verdict(False, 2e-4), False),
        (survival.Verdict(True, math.nan), False),
        (None, False),
    ],
)
def test_verdicts_are_compared_bit_by_bit(other, is_same):
    assert survival.Verdict(True, 2e-4).is_same(other) is is_same
    unknown = survival.Verdict(False, math.nan)
    assert unknown.is_same(survival.Verdict(**json.loads(json.dumps(vars(unknown)))))
