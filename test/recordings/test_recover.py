"""What a damaged recording still holds comes back as it was, and nothing else does."""

import contextlib
import random
import struct
from collections.abc import Iterator
from pathlib import Path

import mcap.reader
import mcap.writer
import pytest
from bench.damage import mutate

from impact_rig.core.given.errors import FileError
from impact_rig.recordings.contents import inspect_run
from impact_rig.recordings.hits import HitState
from impact_rig.recordings.run import Run
from impact_rig.recordings.scan import Scan

from .conftest import OUR_MESSAGES
from .damaged import (
    HITS,
    OURS,
    Place,
    add_hit,
    find_borders,
    find_chunks,
    label,
    read_raw,
    read_recovered,
    recover,
    spoil,
    write_original,
)


@pytest.fixture(params=["zstd", "none"])
def compression(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def list_cuts(path: Path) -> Iterator[int]:
    dice = random.Random(1)
    yield from find_borders(path)[1:]
    yield from (dice.randrange(100, path.stat().st_size) for _ in range(25))


def test_cut_off_anywhere_it_keeps_every_chunk_that_is_whole(make_recording, compression):
    original = write_original(make_recording, compression=compression)
    content, chunks = original.read_bytes(), find_chunks(original)
    assert len(chunks) == HITS + 1
    for cut in list_cuts(original):
        expected = [m for chunk in chunks if chunk.end <= cut for m in chunk.messages]
        damaged = spoil(original, content[:cut])
        assert [message.data for message in Scan(damaged).read_messages()] == [
            message.data for message in expected
        ]
        if not expected:
            with pytest.raises(FileError, match=r"nothing of .* can be recovered"):
                recover(damaged)
            assert not damaged.with_name("good.mcap").exists()
            continue
        assert read_recovered(recover(damaged)) == expected
        assert damaged.read_bytes() == content[:cut]


@pytest.mark.parametrize("number", [0, HITS])
def test_of_an_altered_chunk_nothing_is_taken_and_its_messages_are_counted(
    make_recording, compression, number
):
    original = write_original(make_recording, compression=compression)
    chunks, content = find_chunks(original), bytearray(original.read_bytes())
    place = chunks[number]
    content[(place.data_start + place.end) // 2] ^= 0x10
    recovery = recover(spoil(original, content))
    rest = [m for item in chunks if item is not place for m in item.messages]
    assert read_recovered(recovery) == rest
    assert not recovery.is_complete
    assert recovery.contents.lost == len(place.messages)
    (damage,) = recovery.contents.passes[0].damages
    assert (damage.start, damage.start + damage.size) == (place.start, place.end)


def test_a_flipped_bit_costs_one_chunk_at_most_and_alters_no_message(make_recording, compression):
    original = write_original(make_recording, compression=compression)
    chunks, content = find_chunks(original), original.read_bytes()
    whole = [m for chunk in chunks for m in chunk.messages]
    dice = random.Random(1)
    for _ in range(15):
        spoilt = bytearray(content)
        spoilt[dice.randrange(len(content))] ^= 1 << dice.randrange(8)
        found = read_recovered(recover(spoil(original, spoilt)))
        missing = [m for m in whole if m not in found]
        assert found == [m for m in whole if m not in missing]
        assert not missing or missing in [chunk.messages for chunk in chunks]


def test_bytes_between_the_chunks_are_passed_over(original):
    content = original.read_bytes()
    place = find_chunks(original)[2].start
    for junk in (b"\x00" * 700, random.Random(3).randbytes(5000), content[50:900]):
        spoilt = content[:place] + junk + content[place:]
        assert read_recovered(recover(spoil(original, spoilt))) == read_raw(original)


def test_a_wrong_length_of_a_chunk_costs_that_chunk_alone(original):
    chunks = find_chunks(original)
    place = chunks[2]
    rest = [m for chunk in chunks if chunk is not place for m in chunk.messages]
    for length in (0, 17, place.end - place.start - 10, 10**6, 2**40, 2**64 - 1):
        content = bytearray(original.read_bytes())
        struct.pack_into("<Q", content, place.start + 1, length)
        recovery = recover(spoil(original, content))
        assert recovery.contents.lost == len(place.messages)
        assert read_recovered(recovery) == rest


@pytest.mark.parametrize("kind", ["zstd", "lz4", "none"])
def test_whatever_was_done_to_it_it_is_read_or_refused_and_what_comes_of_it_is_sound(
    make_recording, kind
):
    original = write_original(make_recording, compression=kind)
    for seed in range(30):
        damaged = spoil(original, mutate(original.read_bytes(), seed))
        with contextlib.suppress(FileError):
            list(Run(damaged).events())
        try:
            recovery = recover(damaged)
        except FileError as error:
            assert str(error).isprintable()  # noqa: PT017
            assert not damaged.with_name("good.mcap").exists()
            continue
        assert len(read_recovered(recovery)) == recovery.contents.messages


def test_topics_of_a_lost_first_chunk_are_known_from_the_index(original):
    content, place = bytearray(original.read_bytes()), find_chunks(original)[1]
    content[place.data_start + 40 : place.end] = bytes(place.end - place.data_start - 40)
    recovery = recover(spoil(original, content))
    topics = {topic.name: topic.lost for topic in recovery.contents.topics.values()}
    assert topics["/lab/acceleration"] == 2
    assert recovery.contents.hits[1].state is HitState.SAVED


def test_hits_are_saved_damaged_or_lost(make_recording):
    maker = make_recording("original.mcap", chunk_size=1)
    maker.add_setup()
    for record in range(1, 6):
        add_hit(maker, record)
    original = Path(maker.close())
    chunks = find_chunks(original)
    by_topic: dict[str, list[Place]] = {}
    for chunk in chunks:
        by_topic.setdefault(chunk.messages[0].topic, []).append(chunk)
    content = bytearray(original.read_bytes())
    lost = [by_topic["/acceleration"][place] for place in (3, 4, 5)]
    lost += [places[3] for places in by_topic.values() if len(places) == 5]
    lost += by_topic["/acceleration"][6:8]
    for chunk in lost:
        content[chunk.data_start + 3] ^= 0xFF
    recovery = recover(spoil(original, content))
    reasons = {hit.record: (hit.state.value, hit.reason) for hit in recovery.contents.hits}
    assert reasons == {
        1: ("saved", None),
        2: ("damaged", "1 of 2 blocks are left"),
        3: ("lost", "no block of it is left"),
        4: ("lost", "nothing of it is left"),
        5: ("saved", None),
    }


def test_a_set_up_that_was_heard_late_holds_for_the_hits_before_it(make_recording):
    maker = make_recording("original.mcap")
    add_hit(maker, 1)
    maker.add("release", OURS + "HammerRelease", {**label(2), "swing_time": 0.2})
    maker.add_setup()
    add_hit(maker, 2)
    maker.add_setup(name="another")
    add_hit(maker, 3)
    hits = inspect_run(Run(maker.close())).hits
    assert [(hit.record, hit.campaign, hit.state.value) for hit in hits] == [
        (1, 1, "saved"),
        (2, 1, "saved"),
        (3, 2, "saved"),
    ]


def test_a_release_that_was_called_off_is_no_lost_hit(make_recording):
    maker = make_recording("original.mcap")
    maker.add_setup()
    add_hit(maker, 1)
    maker.add("release", OURS + "HammerRelease", {**label(2), "swing_time": 0.2})
    hits = inspect_run(Run(maker.close())).hits
    assert [(hit.record, hit.state.value) for hit in hits] == [(1, "saved")]


def test_topics_metadata_and_attachments_are_taken_over(original):
    recovery = recover(spoil(original, original.read_bytes()[:-3000]))
    with original.open("rb") as one, recovery.output.open("rb") as other:
        then, now = mcap.reader.make_reader(one), mcap.reader.make_reader(other)
        assert [
            (c.topic, c.message_encoding, c.metadata) for c in then.get_summary().channels.values()
        ] == [
            (c.topic, c.message_encoding, c.metadata) for c in now.get_summary().channels.values()
        ]
        assert [(s.name, s.data) for s in then.get_summary().schemas.values()] == [
            (s.name, s.data) for s in now.get_summary().schemas.values()
        ]
        assert list(then.iter_attachments()) == list(now.iter_attachments())
        records = {item.name: item.metadata for item in now.iter_metadata()}
        assert records["impact_rig"] == {"software_version": "0.1.0", "notes": "Grüße"}
        assert records["impact_rig/recovery"]["recovered_from"] == "damaged.mcap"


@pytest.mark.parametrize(
    ("then", "now", "changes"),
    [
        ("bool last", "bool last", {"origin": {"kind": "dreamt"}}),
        ("bool last", "bool[3] last", {"last": [True, False, True]}),
        ("uint64 first_sample", "string[] first_sample", {"first_sample": ["0"]}),
    ],
)
def test_messages_of_a_later_version_are_copied_and_told(
    make_recording, install, then, now, changes
):
    text = (OUR_MESSAGES / "AccelerationBlock.msg").read_text()
    install("impact_rig_msgs", "AccelerationBlock", text.replace(then, now))
    maker = make_recording()
    maker.add_setup()
    maker.add_block(1, **changes)
    recovered = recover(maker.close())
    assert len(read_recovered(recovered)) == 2
    (remark,) = recovered.contents.remarks
    assert "AccelerationBlock on /acceleration was recorded with another version" in remark
