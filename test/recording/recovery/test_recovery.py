"""What a damaged recording still holds comes back as it was, and nothing else does."""

import json
import random
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mcap.writer
import pytest

from impact_rig.bench.mutations import mutate
from impact_rig.core.errors import FileError
from impact_rig.recording.recovery.inspection import inspect_recording
from impact_rig.recording.recovery.recorded_hits import HitState
from impact_rig.recording.recovery.recovery import recover_recording

from .damaged import (
    HITS,
    find_borders,
    find_chunks,
    list_states,
    read_raw,
    read_recovered,
    recover,
    spoil,
    write_original,
)


def test_of_a_sound_recording_nothing_is_written(original: Path) -> None:
    recovery = recover(original)
    assert recovery.output is None
    assert recovery.is_complete
    assert list(original.parent.glob("*.mcap")) == [original]
    assert set(list_states(recovery).values()) == {HitState.SAVED}


def test_a_recovered_recording_is_sound_and_the_same_each_time(original: Path) -> None:
    damaged = spoil(original, original.read_bytes()[:-3000])
    recovery = recover(damaged)
    assert recovery.output is not None
    first = recovery.output.read_bytes()
    assert recover_recording(recovery.output, original.with_name("again.mcap")).output is None
    assert recover(damaged).output is not None
    assert recovery.output.read_bytes() == first


def list_cuts(path: Path) -> Iterator[int]:
    dice = random.Random(1)
    yield from find_borders(path)[1:]
    yield from (dice.randrange(100, path.stat().st_size) for _ in range(25))


def test_cut_off_anywhere_it_keeps_every_chunk_that_is_whole(
    make_recording: Any, compression: str
) -> None:
    original = write_original(make_recording, compression=compression)
    content, chunks = original.read_bytes(), find_chunks(original)
    assert len(chunks) == HITS + 1
    for cut in list_cuts(original):
        expected = [m for chunk in chunks if chunk.end <= cut for m in chunk.messages]
        damaged = spoil(original, content[:cut])
        if not expected:
            with pytest.raises(FileError, match=r"nothing of .* can be recovered"):
                recover(damaged)
            assert not damaged.with_name("good.mcap").exists()
            continue
        assert read_recovered(recover(damaged)) == expected
        assert damaged.read_bytes() == content[:cut]


def test_killed_between_two_chunks_nothing_is_lost(original: Path) -> None:
    last = find_chunks(original)[-1]
    content = original.read_bytes()
    index_size = content[last.end :].index(b"\x0f" + struct.pack("<Q", 4))
    recovery = recover(spoil(original, content[: last.end + index_size]))
    assert recovery.is_complete
    assert read_recovered(recovery) == read_raw(original)
    assert "never closed" in recovery.contents.problems[0]


def test_a_torn_index_costs_no_message(original: Path) -> None:
    recovery = recover(spoil(original, original.read_bytes()[:-50]))
    assert recovery.is_complete
    assert read_recovered(recovery) == read_raw(original)


def test_a_dropped_index_is_made_anew(original: Path) -> None:
    content = original.read_bytes()
    data_end = content.rindex(b"\x0f" + struct.pack("<Q", 4)) + 13
    footer = b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0)
    recovery = recover(spoil(original, content[:data_end] + footer + content[:8]))
    assert recovery.contents.problems == ("it has no index at its end",)
    assert recovery.is_complete
    assert read_recovered(recovery) == read_raw(original)


@pytest.mark.parametrize("number", range(HITS + 1))
def test_of_an_altered_chunk_nothing_is_taken_and_its_messages_are_counted(
    make_recording: Any, compression: str, number: int
) -> None:
    original = write_original(make_recording, compression=compression)
    chunks, content = find_chunks(original), bytearray(original.read_bytes())
    place = chunks[number]
    content[(place.data_start + place.end) // 2] ^= 0x10
    recovery = recover(spoil(original, content))
    rest = [m for item in chunks if item is not place for m in item.messages]
    assert read_recovered(recovery) == rest
    assert not recovery.is_complete
    lost = recovery.contents.lost + recovery.contents.unverified
    assert lost == len(place.messages)
    (damage,) = recovery.contents.files[0].damages
    assert (damage.start, damage.start + damage.size) == (place.start, place.end)


@pytest.mark.parametrize("seed", range(4))
def test_a_flipped_bit_costs_one_chunk_at_most_and_alters_no_message(
    make_recording: Any, compression: str, seed: int
) -> None:
    original = write_original(make_recording, compression=compression)
    chunks, content = find_chunks(original), original.read_bytes()
    whole = [m for chunk in chunks for m in chunk.messages]
    dice = random.Random(seed)
    for _ in range(15):
        spoilt = bytearray(content)
        spoilt[dice.randrange(len(content))] ^= 1 << dice.randrange(8)
        recovery = recover(spoil(original, spoilt))
        if recovery.output is None:
            continue  # the chance bit was one that tells nobody anything
        found = read_recovered(recovery)
        missing = [m for m in whole if m not in found]
        assert found == [m for m in whole if m not in missing]
        assert not missing or missing in [chunk.messages for chunk in chunks]


def test_bytes_between_the_chunks_are_passed_over(original: Path) -> None:
    content = original.read_bytes()
    place = find_chunks(original)[2].start
    for junk in (b"\x00" * 700, random.Random(3).randbytes(5000), content[50:900]):
        spoilt = content[:place] + junk + content[place:]
        assert read_recovered(recover(spoil(original, spoilt))) == read_raw(original)


def test_a_wrong_length_of_a_chunk_costs_nothing(original: Path) -> None:
    place = find_chunks(original)[2]
    for length in (0, 17, place.end - place.start - 10, 10**6, 2**40, 2**64 - 1):
        content = bytearray(original.read_bytes())
        struct.pack_into("<Q", content, place.start + 1, length)
        recovery = recover(spoil(original, content))
        assert recovery.is_complete
        assert read_recovered(recovery) == read_raw(original)


def test_unverified_messages_are_kept_on_demand_and_listed(make_recording: Any) -> None:
    original = write_original(make_recording, compression="none")
    place, content = find_chunks(original)[2], bytearray(original.read_bytes())
    # The last byte of a block's counts: its message still fits its type.
    content[content.index(b"weak: too weak", place.start) - 900] ^= 1
    damaged = spoil(original, content)
    assert recover(damaged).contents.unverified == 5
    recovery = recover(damaged, keep_unverified=True)
    assert not recovery.is_complete
    kept, whole = read_recovered(recovery), read_raw(original)
    assert len(kept) == len(whole)
    assert sum(one != other for one, other in zip(kept, whole, strict=True)) == 1
    assert recovery.unverified["/lab/acceleration"] == (2, 3)
    assert set(list_states(recovery).values()) == {HitState.SAVED}
    record = inspect_recording(recovery.output).metadata[-2]
    assert json.loads(record.fields["unverified"])["/lab/impact"] == [1]


def test_of_a_chunk_that_is_cut_off_whole_messages_are_kept_on_demand(
    make_recording: Any, compression: str
) -> None:
    original = write_original(make_recording, compression=compression)
    last = find_chunks(original)[-1]
    damaged = spoil(original, original.read_bytes()[: last.end - 40])
    strict, loose = recover(damaged), recover(damaged, keep_unverified=True)
    assert strict.contents.unverified == loose.contents.unverified
    assert loose.written == strict.written + loose.contents.unverified
    whole = read_raw(original)
    assert read_recovered(loose) == whole[: loose.written]
    if compression == "none":
        assert loose.written == len(whole) - 1


def test_nothing_is_overwritten(original: Path) -> None:
    damaged = spoil(original, original.read_bytes()[:-3000])
    with pytest.raises(FileError, match="exists already"):
        recover_recording(damaged, original)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        pytest.param(b"", "is empty", id="empty"),
        pytest.param(b"no recording at all" * 99, "no MCAP recording", id="other kind"),
        pytest.param(b"\x89MCAP0\r\n", "no MCAP recording, or nothing", id="magic alone"),
        pytest.param(bytes(100_000), "no MCAP recording", id="zeros"),
        pytest.param(
            b"\x89MCAP0\r\n\x01" + struct.pack("<QI4sI", 12, 4, b"ros1", 0), "'ros1'", id="ROS 1"
        ),
    ],
)
def test_what_is_no_recording_is_named(tmp_path: Path, content: bytes, words: str) -> None:
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(content)
    with pytest.raises(FileError, match=words):
        recover(damaged)


def test_a_chunk_that_swells_beyond_belief_is_left_out(tmp_path: Path) -> None:
    damaged = tmp_path / "damaged.mcap"
    with damaged.open("wb") as file:
        writer = mcap.writer.Writer(file)
        writer.start("ros2", "somebody")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channel = writer.register_channel("/chatter", "cdr", schema)
        writer.add_message(channel, 1, b"small", 1, 0)
        writer.flush()
        writer.add_message(channel, 2, bytes(70_000_000), 2, 1)
        writer.finish()
    assert damaged.stat().st_size < 10_000
    recovery = recover(damaged)
    assert [item.data for item in read_recovered(recovery)] == [b"small"]
    assert recovery.contents.lost == 1
    assert "larger than can be meant" in recovery.contents.problems[0]


@pytest.mark.parametrize("seed", range(60))
def test_whatever_was_done_to_it_the_result_is_sound(make_recording: Any, seed: int) -> None:
    kind = ("zstd", "lz4", "none")[seed % 3]
    original = write_original(make_recording, compression=kind)
    damaged = spoil(original, mutate(original.read_bytes(), seed))
    try:
        recovery = recover(damaged, keep_unverified=seed % 2 == 1)
    except FileError:
        assert not damaged.with_name("good.mcap").exists()
        return
    if recovery.output is not None:
        assert len(read_recovered(recovery)) == recovery.written
