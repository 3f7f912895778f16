"""A recording is split between hits, each file can be read alone, and nothing is lost."""

import mcap.reader
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.highlevel import AnyReader

from impact_rig.recording.writing.split_contents import HEALTH_RECORD

from .text_recordings import HIT, SECOND, START, Writer, encode, list_hits, read_by_mcap


def test_the_next_file_begins_when_a_hit_is_complete(make):
    recording = make(split_size=8000)
    for number in range(1, 8):
        recording.add_hits(number)
        recording.writer.flush() if number == 1 else recording.writer.sync()
    recording.writer.close()
    assert [list_hits(path) for path in recording.writer.files] == [[1, 2, 3], [4, 5, 6], [7]]


def test_in_continuous_streaming_the_next_file_begins_with_a_chunk(make):
    recording = make(split_size=8000)
    for number in range(1, 8):
        recording.add_hits(number)
        recording.writer.flush()
    recording.writer.close()
    assert [list_hits(path) for path in recording.writer.files] == [[1, 2, 3], [4, 5, 6], [7]]


def test_a_stream_that_is_never_flushed_is_split_too(make):
    recording = make(split_size=8000, chunk_size=4000)
    recording.add_hits(*range(1, 12))
    recording.writer.close()
    hits = [list_hits(path) for path in recording.writer.files]
    assert [number for part in hits for number in part] == list(range(1, 12))
    assert {len(part) for part in hits[:-1]} == {4}


def test_a_flush_does_not_cut_a_hit_in_two(make):
    recording = make(split_size=10_000)
    recording.add_hits(1)
    recording.writer.sync()
    for number in (2, 3, 4):
        recording.add_hits(number)
        recording.writer.flush()
    assert len(recording.writer.files) == 1
    recording.writer.sync()
    assert len(recording.writer.files) == 2


def test_files_are_split_by_time_as_well(make):
    recording = make(split_duration=0.3)
    for number in range(8):
        recording.add_hits(number)
        recording.writer.sync()
    recording.writer.close()
    assert [list_hits(path) for path in recording.writer.files] == [[0, 1, 2, 3], [4, 5, 6, 7], []]


def test_nothing_new_begins_no_file(make):
    recording = make(split_size=1)
    recording.add(recording.setup, b"set-up")
    for _ in range(3):
        recording.writer.sync()
        recording.writer.flush()
    assert len(recording.writer.files) == 2


def test_each_file_can_be_read_alone(make):
    recording = make(split_size=1)
    recording.writer.add_metadata("impact_rig", {"notes": "old"})
    recording.writer.add_metadata("impact_rig", {"notes": "new"})
    recording.writer.add_attachment("rig.toml", "application/toml", b"[hammer]")
    recording.add(recording.setup, b"first")
    recording.add(recording.setup, b"second")
    recording.add_hits(1)
    recording.writer.sync()
    recording.add_hits(2)
    recording.writer.close()

    first, second = recording.writer.files
    assert [(topic, number) for topic, number, _ in read_by_mcap(first)] == [
        ("/setup", 0),
        ("/setup", 1),
        ("/acceleration", 0),
    ]
    # The number of the repeated message tells that it is no new one.
    assert [(topic, number, text[:6]) for topic, number, text in read_by_mcap(second)] == [
        ("/setup", 1, "second"),
        ("/acceleration", 1, "2 xxxx"),
    ]
    with second.open("rb") as file:
        reader = mcap.reader.make_reader(file, validate_crcs=True)
        records = {record.name: record.metadata for record in reader.iter_metadata()}
        attachments = [
            (item.name, item.media_type, item.data) for item in reader.iter_attachments()
        ]
        messages = [message for _, _, message in reader.iter_messages()]
    assert records["impact_rig"] == {"notes": "new"}
    assert attachments == [("rig.toml", "application/toml", b"[hammer]")]
    assert [message.log_time - START for message in messages] == [
        3 * SECOND // 10,
        4 * SECOND // 10,
    ]
    assert messages[0].publish_time == START + 2 * SECOND // 10 - 1000
    assert (recording.writer.messages, recording.writer.count_messages("/setup")) == (4, 2)


def test_a_stream_is_not_repeated(make):
    recording = make(split_size=1)
    recording.add_hits(1)
    recording.writer.sync()
    recording.writer.close()
    assert [list_hits(path) for path in recording.writer.files] == [[1], []]


def test_the_health_of_a_file_stays_in_it(make):
    def tell_health() -> None:
        recording.writer.add_metadata(HEALTH_RECORD, {"end": "split"})

    recording = make(split_size=1, before_split=tell_health)
    recording.add_hits(1)
    recording.writer.sync()
    recording.add_hits(2)
    recording.writer.add_metadata(HEALTH_RECORD, {"end": "closed"})
    recording.writer.close()
    ends = []
    for path in recording.writer.files:
        with path.open("rb") as file:
            records = mcap.reader.make_reader(file).iter_metadata()
            ends.append([item.metadata["end"] for item in records if item.name == HEALTH_RECORD])
    assert ends == [["split"], ["closed"]]


def test_rosbags_reads_all_files_of_a_folder_as_one(make, tmp_path):
    recording = make(split_size=1)
    recording.add(recording.setup, b"set-up")
    for number in (1, 2, 3):
        recording.add_hits(number)
        recording.writer.sync()
    recording.writer.close()
    with AnyReader([tmp_path / "session"]) as reader:
        found = [(item.topic, time, data) for item, time, data in reader.messages()]
        counts = {item.topic: item.msgcount for item in reader.connections}
        assert reader.message_count == len(found)
    assert [data[:10] for topic, _, data in found if topic == "/acceleration"] == [
        encode(b"%d " % number + HIT)[:10] for number in (1, 2, 3)
    ]
    assert counts == {"/setup": 4, "/acceleration": 3}
    times = [time for _, time, _ in found]
    assert times == sorted(times)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.sampled_from(["setup", "hit", "flush", "sync"]), max_size=20))
def test_whatever_the_order_nothing_is_lost_or_counted_twice(tmp_path_factory, steps):
    recording = Writer(tmp_path_factory.mktemp("law") / "session", split_size=5000)
    added = []
    for number, step in enumerate(steps):
        if step == "hit":
            recording.add_hits(number)
            added.append(("/acceleration", str(number)))
        elif step == "setup":
            recording.add(recording.setup, b"%d" % number)
            added.append(("/setup", str(number)))
        else:
            getattr(recording.writer, step)()
    recording.writer.close()
    seen = set()
    found = []
    for path in recording.writer.files:
        for topic, sequence, text in read_by_mcap(path):
            if (topic, sequence) not in seen:
                seen.add((topic, sequence))
                found.append((topic, text.split()[0]))
    assert found == added
    assert recording.writer.messages == len(added)
