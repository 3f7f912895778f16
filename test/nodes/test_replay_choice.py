"""What of a recording is replayed: chosen hits, folders of files, no other interfaces."""

from collections import Counter

import pytest
from impact_rig_msgs.msg import RigSetup
from impact_rig_msgs.srv import GetResults
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from impact_rig.core.setup.paper import CONTROL_SAMPLE
from impact_rig.nodes import interfaces
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.replayer import ReplayerNode
from impact_rig.nodes.topics import name_type
from impact_rig.recordings.schemas import MessageDefinition, find_message_definition
from impact_rig.recordings.source import RecordingSource
from impact_rig.recordings.writer import McapWriter

from .replays import PEER, START, make_hits, wait_for_end, write_recording

NOTES = interfaces.Topic("notes", String, interfaces.IMPACT.qos)
OF_A_HIT = (interfaces.RELEASE, interfaces.VIRTUAL_IMPACT, interfaces.ACCELERATION)


def count_messages(collectors):
    return {name: len(collector.messages) for name, collector in collectors.items()}


@pytest.mark.parametrize(
    ("parameters", "records"),
    [
        ({"hits": ["steel small/2", f"{CONTROL_SAMPLE}/1.1"]}, [1, 5]),
        ({"samples": ["steel small"], "hits": ["3"]}, [3, 4, 5]),
    ],
)
def test_a_chosen_hit_brings_all_its_messages_and_what_belongs_to_no_hit_stays(
    harness, tmp_path, parameters, records
):
    hits = make_hits({CONTROL_SAMPLE: 3, "steel small": 2})
    hits.insert(4, (0.0, NOTES, String(data="a note")))
    path = write_recording(tmp_path / "session.mcap", hits)
    collectors = {
        topic.name: harness.listen(topic) for topic in (interfaces.SETUP, NOTES, *OF_A_HIT)
    }
    node = harness.add(
        ReplayerNode, file=str(path), rate=0.0, topics="all", required_subscribers=PEER,
        **parameters,
    )  # fmt: skip
    wait_for_end(harness, node)
    expected = Counter({"setup": 1, "notes": 1})
    for _, topic, message in hits:
        expected[topic.name] += topic in OF_A_HIT and message.record in records
    harness.wait_until(lambda: count_messages(collectors) == dict(expected))
    for topic in OF_A_HIT:
        found = list(dict.fromkeys(item.record for item in collectors[topic.name].messages))
        assert found == records


def test_the_time_of_what_is_left_out_is_not_waited_for(harness, tmp_path):
    hits = make_hits({CONTROL_SAMPLE: 3})
    # The second hit, which is left out, came an hour after the first.
    late = [
        (time + 3600.0 * (getattr(message, "record", 0) > 1), topic, message)
        for time, topic, message in hits
    ]
    path = write_recording(tmp_path / "session.mcap", late)
    blocks = harness.listen(interfaces.ACCELERATION)
    node = harness.add(
        ReplayerNode, file=str(path), hits=["1", "3"], required_subscribers=PEER, rate=10.0
    )
    wait_for_end(harness, node)
    blocks.wait(lambda items: {item.record for item in items} == {1, 3})


def copy_messages(messages, path):
    with McapWriter(path) as writer:
        channels = {}
        for channel, _, log_time, publish_time, data in messages:
            if channel.id not in channels:
                definition = MessageDefinition(channel.type_name, channel.schema)
                channels[channel.id] = writer.add_channel(channel.topic, definition, ())
            writer.add_message(channels[channel.id], data, log_time, publish_time)


def test_the_files_of_a_folder_are_one_recording(harness, tmp_path):
    hits = make_hits({CONTROL_SAMPLE: 4})
    messages = [*RecordingSource(write_recording(tmp_path / "whole.mcap", hits)).read_messages()]
    middle = next(i for i, item in enumerate(hits) if getattr(item[2], "record", 0) == 3)
    folder = tmp_path / "run" / "session"
    folder.mkdir(parents=True)
    # Each file begins with the set-up, so that it can be read alone.
    for number, part in enumerate((messages[:middle], [messages[0], *messages[middle:]])):
        copy_messages(part, folder / f"session_{number}.mcap")
    setups = harness.listen(interfaces.SETUP)
    harness.add(EstimatorNode)
    impacts = harness.listen(interfaces.IMPACT)
    node = harness.add(ReplayerNode, file=str(tmp_path / "run"), rate=0.0)
    wait_for_end(harness, node)
    assert [item.record for item in impacts.wait_for_count(4)] == [1, 2, 3, 4]
    (sample,) = harness.call(GetResults, interfaces.GET_RESULTS).samples
    assert sample.impacts_accepted == 4
    assert len(setups.messages) == 1
    assert node.describe_state()["messages"] == len(hits)


def test_a_topic_nobody_needs_is_left_out_if_its_type_is_unknown(harness, tmp_path):
    hits = make_hits({CONTROL_SAMPLE: 1})
    path = tmp_path / "session.mcap"
    with McapWriter(path) as writer:
        setup = writer.add_channel("/setup", find_message_definition(name_type(RigSetup)), ())
        writer.add_message(setup, serialize_message(hits[0][2]), START, START)
        unknown = writer.add_channel("/odd", MessageDefinition("odd_msgs/msg/Odd", "uint8 x"), ())
        writer.add_message(unknown, b"\0\1\0\0\1", START, START)
    node = harness.add(ReplayerNode, file=str(path), topics="all")
    assert node.fault == ""
    assert any("odd_msgs/msg/Odd is not installed" in text for text in node.recording.warnings)
