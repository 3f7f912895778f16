"""What of a recording is replayed: chosen hits, folders of files, recordings of older versions."""

from collections import Counter

import pytest
from impact_rig_msgs.msg import AccelerationBlock, RigSetup
from impact_rig_msgs.srv import GetResults
from mcap_ros2._dynamic import serialize_dynamic
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import String

from impact_rig.core.session import Session
from impact_rig.core.setup.paper import CONTROL_SAMPLE
from impact_rig.core.signals.record import Block
from impact_rig.nodes import interfaces
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.replayer import ReplayerNode
from impact_rig.nodes.result_messages import result_from_msg
from impact_rig.nodes.topics import name_type
from impact_rig.recording.interfaces.message_definitions import (
    MessageDefinition,
    find_message_definition,
)
from impact_rig.recording.reading.mcap_file import McapFile
from impact_rig.recording.reading.mcap_reader import read_recording
from impact_rig.recording.writing.mcap_writer import McapWriter
from impact_rig.results.estimates import SampleResults
from impact_rig.results.flat_estimates import sample_results_from_estimate

from .replays import PEER, START, make_hits, wait_for_end, write_recording

NOTES = interfaces.Topic("notes", String, interfaces.IMPACT.qos)
OF_A_HIT = (interfaces.RELEASE, interfaces.VIRTUAL_IMPACT, interfaces.ACCELERATION)


def count_messages(collectors):
    return {name: len(collector.messages) for name, collector in collectors.items()}


@pytest.mark.parametrize(
    ("parameters", "records"),
    [
        ({"samples": ["steel small"]}, [4, 5]),
        ({"hits": ["2"]}, [2]),
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
    messages = [*McapFile(write_recording(tmp_path / "whole.mcap", hits)).read_messages()]
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


OLD = {
    "impact_rig_msgs/msg/RigSetup": ("hammer_stiffness", "clock_uncertainty", "keep_hits"),
    "impact_rig_msgs/msg/AccelerationBlock": ("values",),
}
"""Fields that an older version did not have."""


def make_old(recording, path):
    """Write a recording as an older version would have, by an encoder of other people."""
    writer, channels, encoders = McapWriter(path), {}, {}
    for message in McapFile(recording).read_messages():
        name = message.channel.type_name
        if name not in OLD:
            continue
        if name not in channels:
            lines = find_message_definition(name).text.splitlines()
            text = "\n".join(
                line for line in lines if not {*line.partition("#")[0].split()} & {*OLD[name]}
            )
            channels[name] = writer.add_channel(
                message.channel.topic,
                MessageDefinition(name, text),
                (),
            )
            encoders[name] = serialize_dynamic(name, text)[name]
        kind = RigSetup if name.endswith("RigSetup") else AccelerationBlock
        data = encoders[name](deserialize_message(message.data, kind))
        writer.add_message(channels[name], data, message.log_time, message.log_time)
    writer.close()
    return path


def test_a_recording_of_an_older_version_gives_the_numbers_of_its_analysis(harness, tmp_path):
    hits = make_hits({CONTROL_SAMPLE: 3, "steel small": 3})
    path = make_old(write_recording(tmp_path / "new.mcap", hits), tmp_path / "old.mcap")
    harness.add(EstimatorNode)
    impacts = harness.listen(interfaces.IMPACT)
    setups = harness.listen(interfaces.SETUP)
    node = harness.add(ReplayerNode, file=str(path), rate=0.0)
    impacts.wait_for_count(6)
    wait_for_end(harness, node)
    (setup,) = setups.wait_for_count(1)
    assert setup.hammer_stiffness != setup.hammer_stiffness  # NaN: from the control experiment
    assert setup.header.stamp.sec == START // 10**9

    recording = read_recording(path)
    session = Session(recording.setup)
    for event in recording.events():
        if isinstance(event, Block):
            session.feed(event)
    answer = harness.call(GetResults, interfaces.GET_RESULTS)
    assert len(answer.samples) == 2
    for found, expected in zip(answer.samples, session.estimate_all().samples, strict=True):
        assert repr(result_from_msg(SampleResults, found)) == repr(
            sample_results_from_estimate(expected)
        )


def test_the_log_says_what_was_filled_up(start_process, tmp_path):
    hits = make_hits({CONTROL_SAMPLE: 1})
    path = make_old(write_recording(tmp_path / "new.mcap", hits), tmp_path / "old.mcap")
    process = start_process(
        "replayer", required_subscribers="''", file=str(path), rate=0.0, exit_when_done=True
    )
    assert process.wait() == 0
    assert "RigSetup.hammer_stiffness = nan" in process.output
    assert "Channel.values = ()" in process.output


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
