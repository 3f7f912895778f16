"""The parts measure what they say, here on very little."""

import json
import math
import struct
import sys
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from impact_rig.bench import fuzz_process
from impact_rig.bench.part import Bench
from impact_rig.bench.parts import batch, fuzz, kill, read, write
from impact_rig.bench.recordings import COMPRESSIONS
from impact_rig.core.errors import FileError


def read_all(path: Path) -> list[tuple[str, int, bytes]]:
    with path.open("rb") as file:
        return [
            (channel.topic, message.log_time, message.data)
            for _, channel, message in make_reader(file).iter_messages()
        ]


def test_reading_is_compared_in_each_compression(bench: Bench) -> None:
    figures = read.measure(bench)
    assert [figure.name.split(",")[0] for figure in figures] == list(COMPRESSIONS)
    for figure in figures:
        assert len(figure.values) == bench.extent.repeats
        assert str(figure.goal) == "at most 2"


def test_both_writers_are_compared_in_each_compression(bench: Bench, monkeypatch: Any) -> None:
    monkeypatch.setattr(write, "MESSAGES", 20)
    figures = write.measure(bench)
    assert [figure.name.split(",")[0] for figure in figures] == list(COMPRESSIONS)
    for figure in figures:
        assert len(figure.values) == bench.extent.repeats
        assert str(figure.goal) == "at least 0.8"
    assert list(bench.folder.iterdir()) == []


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_both_writers_write_the_same_messages(tmp_path: Path, compression: str) -> None:
    ours, bare = tmp_path / "ours.mcap", tmp_path / "bare.mcap"
    messages = [bytes([number]) * 8 for number in range(20)]
    write.write_as_recorder(ours, messages, compression)
    write.write_bare(bare, messages, compression)
    assert read_all(ours) == read_all(bare)
    assert [data for _, _, data in read_all(ours)] == messages


def test_two_workers_are_compared_with_one(bench: Bench, monkeypatch: Any) -> None:
    monkeypatch.setattr(batch, "REPEATS", 1)
    monkeypatch.setattr(batch, "RECORDINGS", 2)
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1})
    gain, one, start = batch.measure(bench)
    assert gain.values[0] > 0.1
    assert str(gain.goal) == "at least 1.7"
    assert one.unit == start.unit == "s"


def test_damaged_recordings_are_all_read_in_all_ways(bench: Bench) -> None:
    faults, number, *ways, memory = fuzz.measure(bench)
    assert faults.values == (0.0,)
    assert number.values == (6.0,)
    assert sum(figure.values[0] for figure in ways) == 6 * len(fuzz_process.OPERATIONS)
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
def test_what_is_no_refusal_in_words_is_a_fault(error: Any, outcome: str) -> None:
    def operate(_: Path) -> None:
        if error is not None:
            raise error

    assert fuzz_process.try_operation(operate, Path()) == outcome


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
    bench: Bench,
    monkeypatch: Any,
    tmp_path: Path,
    fault: str,
    words: str,
) -> None:
    (tmp_path / "process.py").write_text(PROCESS.format(fault=fault))
    start = fuzz.subprocess.Popen

    def start_other(command: list[str], **options: Any) -> Any:
        return start([sys.executable, tmp_path / "process.py", *command[-2:]], **options)

    monkeypatch.setattr(fuzz.subprocess, "Popen", start_other)
    monkeypatch.setattr(fuzz, "TIME_LIMIT", 3.0)
    faults, _, reads, _ = fuzz.measure(bench)
    assert faults.values == (1.0,)
    assert faults.note.startswith("seed 3: ")
    assert words in faults.note
    assert reads.values == (5.0,)


def test_the_verdicts_of_a_killed_recording_are_those_of_its_whole_hits(
    recording: Path, tmp_path: Path
) -> None:
    whole = kill.recover_verdicts(recording)
    assert list(whole) == [1, 2, 3]
    content = recording.read_bytes()
    with recording.open("rb") as file:
        last = make_reader(file).get_summary().chunk_indexes[-1]
    cut = tmp_path / "session.mcap"
    cut.write_bytes(content[: last.chunk_start_offset + 100])
    found = kill.recover_verdicts(cut)
    assert list(found) == [1, 2]
    assert all(verdict.is_same(whole[record]) for record, verdict in found.items())
    cut.write_bytes(b"")
    assert kill.recover_verdicts(cut) == {}


@pytest.mark.parametrize(
    ("other", "is_same"),
    [
        (kill.Verdict(True, 2e-4), True),
        (kill.Verdict(True, math.nextafter(2e-4, 1.0)), False),
        (kill.Verdict(False, 2e-4), False),
        (kill.Verdict(True, math.nan), False),
        (None, False),
    ],
)
def test_verdicts_are_compared_bit_by_bit(other: Any, is_same: bool) -> None:
    assert kill.Verdict(True, 2e-4).is_same(other) is is_same
    unknown = kill.Verdict(False, math.nan)
    assert unknown.is_same(kill.Verdict(**json.loads(json.dumps(vars(unknown)))))
