"""The recorder says when a record is on the disk, what it lacks, and when the disk is full."""

import threading
from array import array

from diagnostic_msgs.msg import DiagnosticStatus
from impact_rig_msgs.msg import AccelerationBlock, StreamBlock
from std_msgs.msg import Empty

from impact_rig.nodes import interfaces

from .test_recorder import count_whole_messages, read_by_rosbags, read_metadata

POINTS = 1000


def make_blocks(record, count=3, *, without=(), ends=True):
    """Return the blocks of a record, some of them missing."""
    blocks = []
    for i in set(range(count)) - set(without):
        block = AccelerationBlock(
            record=record, sample="brass", impact=record, attempt=1, first_sample=i * POINTS,
            sampling_rate=2.5e6, last=ends and i == count - 1,
        )  # fmt: skip
        block.header.stamp.sec = 1000 * record + i
        block.hammer.scale = block.specimen.scale = 1.0
        block.hammer.counts = block.specimen.counts = array("i", range(POINTS))
        blocks.append(block)
    return blocks


def connect(harness, topic=interfaces.ACCELERATION):
    publisher = harness.advertise(topic)
    harness.wait_until(lambda: publisher.get_subscription_count() > 0)
    return publisher


def publish(publisher, messages):
    for message in messages:
        publisher.publish(message)


def is_warned(diagnostics):
    return diagnostics[-1].status[0].level == DiagnosticStatus.WARN


def list_values(diagnostics):
    return [(item.key, item.value) for item in diagnostics.status[0].values]


def test_every_record_is_on_the_disk_when_the_recorder_says_so(harness, recorder, tmp_path):
    _, stored, _ = recorder()
    publisher = connect(harness)
    for record in (1, 2, 3):
        publish(publisher, make_blocks(record))
        word = stored.wait_for_count(record)[-1]
        assert count_whole_messages(tmp_path / "session.mcap", "/acceleration") == 3 * record
        assert (word.record, word.sample, word.impact, word.attempt) == (
            record,
            "brass",
            record,
            1,
        )
        assert (word.blocks, word.gaps, word.missing_points) == (3, 0, 0)
        assert word.header.stamp.sec == 1000 * record + 2


def test_what_records_lack_is_told_counted_and_kept_in_the_file(harness, recorder, tmp_path):
    states, stored, _ = recorder()
    diagnostics = harness.listen(interfaces.DIAGNOSTICS)
    publisher = connect(harness)
    publish(publisher, [*make_blocks(1, 5, without={1, 3}), *make_blocks(2)])
    first, second = stored.wait_for_count(2)
    assert (first.blocks, first.gaps, first.missing_points) == (3, 2, 2 * POINTS)
    assert (second.blocks, second.gaps) == (3, 0)
    warned = states.wait(lambda messages: messages[-1].message.startswith("warning:"))[-1]
    assert warned.recording
    assert (warned.gaps, warned.missing_points) == (2, 2 * POINTS)
    told = diagnostics.wait(is_warned)[-1]
    assert "2 gaps, 2000 points are missing" in told.status[0].message
    assert ("gaps", "2") in list_values(told)


def test_messages_that_a_full_queue_dropped_are_counted(harness, recorder, monkeypatch):
    depth = interfaces.ACCELERATION.qos.depth
    monkeypatch.setattr("impact_rig.nodes.recorder_run.QUEUE_DEPTH", depth)
    states, stored, _ = recorder()
    publisher = connect(harness)
    publish(publisher, make_blocks(1))
    stored.wait_for_count(1)
    standing, go_on = threading.Event(), threading.Event()

    def stand_still():
        standing.set()
        go_on.wait(20.0)

    busy = threading.Thread(target=lambda: harness.run(stand_still))
    busy.start()
    assert standing.wait(20.0)
    publish(publisher, make_blocks(2, 230))
    go_on.set()
    busy.join()
    word = stored.wait_for_count(2)[-1]
    assert (word.blocks, word.gaps, word.missing_points) == (depth, 1, (230 - depth) * POINTS)
    state = states.wait(lambda messages: messages[-1].messages_lost > 0)[-1]
    assert state.messages_lost == 230 - depth


def test_a_full_disk_ends_the_recording_cleanly_and_says_so(
    harness, recorder, tmp_path, monkeypatch
):
    states, stored, _ = recorder()
    diagnostics = harness.listen(interfaces.DIAGNOSTICS)
    publisher = connect(harness)
    publish(publisher, make_blocks(1))
    stored.wait_for_count(1)
    monkeypatch.setattr("impact_rig.recordings.new_file.DiskFile._measure_room", lambda _: 1000)
    # The writer asks for the room on the disk less often than for each message.
    for record in range(2, 100):
        publish(publisher, make_blocks(record, 100))
        harness.wait_until(
            lambda record=record: (
                len(stored.messages) >= record or not states.messages[-1].recording
            )
        )
        if not states.messages[-1].recording:
            break
    assert "full" in states.messages[-1].message
    diagnostics.wait(lambda got: got[-1].status[0].level == DiagnosticStatus.ERROR)
    path = tmp_path / "session.mcap"
    records = [block.record for block in read_by_rosbags(path)["/acceleration"]]
    whole = {record for record in records if records.count(record) in (3, 100)}
    assert {message.record for message in stored.messages} <= whole
    (health,) = read_metadata(path, "impact_rig/health")
    assert health["reason"] == "disk full"


def make_stream(*starts):
    """Return blocks of the running stream that begin at given points."""
    blocks = [StreamBlock(first_sample=start, sampling_rate=2.5e6) for start in starts]
    for block in blocks:
        block.hammer.scale = block.specimen.scale = 1.0
        block.hammer.counts = block.specimen.counts = array("i", range(POINTS))
    return blocks


def test_the_running_stream_is_recorded_when_asked_for_and_its_gaps_are_counted(
    harness, recorder, tmp_path
):
    states, _, node = recorder(record_stream=True)
    diagnostics = harness.listen(interfaces.DIAGNOSTICS)
    publish(connect(harness, interfaces.STREAM), make_stream(0, POINTS, 4 * POINTS, 7 * POINTS))
    warned = states.wait(lambda messages: messages[-1].message.startswith("warning:"))[-1]
    assert (warned.gaps, warned.missing_points) == (2, 4 * POINTS)
    assert "the stream has 2 gaps, 4000 points are missing" in warned.message
    told = diagnostics.wait(lambda got: ("stream gaps", "2") in list_values(got[-1]))[-1]
    assert ("stream blocks", "4") in list_values(told)
    harness.close(node)
    path = tmp_path / "session.mcap"
    stream = read_by_rosbags(path)["/acceleration/stream"]
    assert [block.first_sample for block in stream] == [0, POINTS, 4 * POINTS, 7 * POINTS]
    (health,) = read_metadata(path, "impact_rig/health")
    assert (health["stream_blocks"], health["stream_gaps"]) == ("4", "2")
    assert (health["stream_missing_points"], health["gaps"]) == ("4000", "0")


def test_the_running_stream_is_left_alone_unless_asked_for(harness, recorder, tmp_path):
    _, stored, node = recorder()
    streams = [
        harness.peer.create_publisher(StreamBlock, name, 10)
        for name in ("/acceleration/stream", "/hall/acceleration/stream")
    ]
    other = harness.peer.create_publisher(Empty, "/later", 1)
    # What is published like the stream is discovered, it is not.
    harness.wait_until(lambda: other.get_subscription_count() > 0)
    assert [stream.get_subscription_count() for stream in streams] == [0, 0]
    publish(connect(harness), make_blocks(1))
    stored.wait_for_count(1)
    harness.close(node)
    topics = read_by_rosbags(tmp_path / "session.mcap")
    assert "/acceleration" in topics
    assert not {topic for topic in topics if "stream" in topic}
