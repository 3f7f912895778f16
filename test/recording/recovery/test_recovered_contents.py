"""What a recovered recording tells: hits, topics, notes, and what was lost of them."""

from pathlib import Path
from typing import Any

import mcap.reader
import pytest
from rosbags.highlevel import AnyReader

from impact_rig.core.errors import FileError
from impact_rig.recording.recovery.inspection import inspect_recording
from impact_rig.recording.recovery.recorded_hits import HitState
from impact_rig.recording.recovery.recovery import name_output, recover_recording

from .damaged import (
    HITS,
    OURS,
    Place,
    add_hit,
    find_chunks,
    label,
    list_states,
    read_recovered,
    recover,
    spoil,
    write_original,
)


def test_topics_of_a_lost_first_chunk_are_known_from_the_index(original: Path) -> None:
    content, place = bytearray(original.read_bytes()), find_chunks(original)[1]
    content[place.data_start + 40 : place.end] = bytes(place.end - place.data_start - 40)
    recovery = recover(spoil(original, content))
    topics = {topic.name: topic.lost + topic.unverified for topic in recovery.contents.topics}
    assert topics["/lab/acceleration"] == 2
    assert list_states(recovery)[2] is HitState.SAVED


def test_without_any_description_messages_are_counted_as_lost(make_recording: Any) -> None:
    original = write_original(make_recording)
    place, content = find_chunks(original)[1], bytearray(original.read_bytes())
    content[place.data_start + 8 : place.data_start + 60] = bytes(52)
    cut = find_chunks(original)[-1].end
    contents = inspect_recording(spoil(original, content[:cut]))
    assert contents.unknown_messages == 5 * (HITS - 1)
    assert "not described" in " ".join(contents.problems)


def test_hits_are_saved_damaged_or_lost(make_recording: Any) -> None:
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
        1: ("saved", ""),
        2: ("damaged", "1 of 2 blocks are left"),
        3: ("lost", "no block of it is left"),
        4: ("lost", "nothing of it is left"),
        5: ("saved", ""),
    }


def test_a_set_up_that_was_heard_late_holds_for_the_hits_before_it(make_recording: Any) -> None:
    maker = make_recording("original.mcap")
    add_hit(maker, 1)
    maker.add("release", OURS + "HammerRelease", {**label(2), "swing_time": 0.2})
    maker.add_setup()
    add_hit(maker, 2)
    maker.add_setup(name="another")
    add_hit(maker, 3)
    hits = inspect_recording(Path(maker.close())).hits
    assert [(hit.record, hit.campaign, hit.state.value) for hit in hits] == [
        (1, 1, "saved"),
        (2, 1, "saved"),
        (3, 2, "saved"),
    ]


def test_topics_metadata_and_attachments_are_taken_over(original: Path) -> None:
    recovery = recover(spoil(original, original.read_bytes()[:-3000]))
    assert recovery.output is not None
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


def test_other_libraries_read_what_was_recovered(original: Path) -> None:
    from mcap_ros2.reader import read_ros2_messages

    recovery = recover(spoil(original, original.read_bytes()[:-3000]))
    assert recovery.output is not None
    raw = read_recovered(recovery)
    decoded = [(m.channel.topic, m.ros_msg) for m in read_ros2_messages(str(recovery.output))]
    assert [topic for topic, _ in decoded] == [item.topic for item in raw]
    assert [m.record for topic, m in decoded if topic == "/lab/impact"] == [1, 2, 3, 4][: len(raw)]
    with AnyReader([recovery.output]) as reader:
        assert [
            (connection.topic, time, data) for connection, time, data in reader.messages()
        ] == [(item.topic, item.log_time, item.data) for item in raw]


def test_a_folder_becomes_a_folder_with_its_list(make_recording: Any, tmp_path: Path) -> None:
    folder = tmp_path / "session"
    folder.mkdir()
    one = write_original(make_recording)
    content = one.read_bytes()
    (folder / "session_0.mcap").write_bytes(content)
    (folder / "session_1.mcap").write_bytes(content[: find_chunks(one)[2].end])
    (folder / "session_2.mcap").write_bytes(b"")
    assert name_output(folder) == tmp_path / "session.recovered"
    recovery = recover_recording(folder, name_output(folder))
    assert recovery.output is not None
    names = sorted(path.name for path in recovery.output.iterdir())
    assert names == [
        "metadata.yaml",
        "session.recovered_0.mcap",
        "session.recovered_1.mcap",
    ]
    assert inspect_recording(recovery.output).is_sound
    with AnyReader([recovery.output]) as reader:
        assert len(list(reader.messages())) == recovery.written
    with pytest.raises(FileError, match="exists already"):
        recover_recording(folder, recovery.output)
    assert not list(tmp_path.glob(".*.part"))
