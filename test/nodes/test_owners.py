"""On a topic of the rig one node speaks: a second is named, and nothing is armed or believed."""

import signal

import pytest
from impact_rig_msgs.srv import Act

from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.nodes.rig_node import RigNode

from .campaigns import arm, begin, cancel, start_rig


def go_on(harness, feedback):
    """Arm until there is another hit: a busy machine disarms again."""
    seen = feedback.messages[-1].impact

    def is_struck():
        harness.call(Act, interfaces.ARM_HAMMER)
        return feedback.messages[-1].impact > seen

    harness.wait_until(is_struck)


def speak(harness, topic, *, is_leased=False):
    """Become a publisher of a topic, as a node without a lease or as one of the rig is."""
    qos = topic.leased_qos if is_leased else topic.qos
    publisher = harness.peer.create_publisher(topic.type, topic.name, qos)
    publisher.publish(topic.type())
    return publisher


def test_who_speaks_beside_an_owner_is_named_on_every_topic_and_nothing_is_armed(harness):
    client = start_rig(harness, campaign={"verdict_timeout": 1.0})
    handle, feedback = begin(harness, client, samples=["steel small"], impacts=100_000)
    feedback.wait(lambda got: got[-1].impact >= 1)
    states = harness.listen(interfaces.HAMMER_STATE)
    found = 0
    for topic in interfaces.OWNED_TOPICS:
        if topic is interfaces.STREAM:
            continue  # it has no publisher in triggered mode
        publisher = speak(harness, topic)
        told = f"/peer speaks on {topic.name} beside its {topic.owners[0]}: end that node"
        # Who listens cannot know which of two hammers says so: the campaign does.
        feedback.wait(lambda got, told=told: told in got[-1].message)
        assert harness.call(Act, interfaces.ARM_HAMMER).message == told
        harness.run(lambda publisher=publisher: harness.peer.destroy_publisher(publisher))
        go_on(harness, feedback)
        found += 1
    assert found == len(interfaces.OWNED_TOPICS) - 1
    result = cancel(harness, handle).result
    hits = sorted([*result.accepted, *result.rejected], key=lambda hit: hit.record)
    assert len({hit.record for hit in hits}) == len(hits)
    assert any(
        "/peer speaks on impact" in text for text in harness.find(RecorderNode).intake.strangers
    )
    assert states.messages[-1].message


@pytest.mark.parametrize("is_leased", [False, True])
def test_of_a_topic_with_two_speakers_nothing_is_believed_and_of_one_everything(
    harness, is_leased
):
    topic = interfaces.RECORD_STORED
    heard = []
    node = harness.add(lambda **options: RigNode("listener", **options))
    node.intake.look_period = 0.0
    harness.run(lambda: node.listen(topic, heard.append))
    # Whoever speaks alone is the owner, whatever it is called.
    first = speak(harness, topic, is_leased=is_leased)
    harness.wait_until(lambda: len(heard) == 1)
    assert node.intake.find_any_stranger() is None
    harness.add(RecorderNode, autostart=False)
    harness.wait_until(lambda: node.intake.find_stranger(topic) is not None)
    first.publish(topic.type())
    harness.wait_until(lambda: node.intake.ignored == 1)
    harness.run(lambda: harness.peer.destroy_publisher(first))
    harness.wait_until(lambda: node.intake.find_stranger(topic) is None)
    assert len(heard) == 1


def test_a_node_that_was_killed_and_started_again_is_no_stranger_to_itself(harness, start_process):
    """The middleware keeps the publishers of a killed process for a minute."""
    harness.add(AccelerometerNode)
    hammer = harness.add(HammerNode)
    estimator = start_process("estimator")
    count = lambda: harness.peer.count_publishers(interfaces.IMPACT.name)  # noqa: E731
    harness.wait_until(lambda: count() == 1)
    estimator.process.send_signal(signal.SIGKILL)
    estimator.wait()
    start_process("estimator")
    harness.wait_until(lambda: count() == 2)
    assert hammer.intake.find_any_stranger() is None
    arm(harness)
