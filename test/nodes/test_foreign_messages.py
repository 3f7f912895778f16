"""What is not of a campaign changes nothing in it, in its recording and for its client."""

import math

import mcap.reader
import pytest
from bench.stranger import TOPICS, Stranger
from impact_rig_msgs import msg
from impact_rig_msgs.action import RunCampaign
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from impact_rig.nodes import interfaces
from impact_rig.nodes.campaign_client import CampaignClient
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.nodes.visualizer import VisualizerNode
from impact_rig.recordings.scan import Scan

from .campaigns import arm, begin, cancel, run, start_rig


def read_health(path):
    """Return how the recording ended, by another library."""
    with path.open("rb") as file:
        records = mcap.reader.make_reader(file).iter_metadata()
        return next(item.metadata for item in records if item.name == "impact_rig/health")


def test_one_campaign_after_the_other_has_no_foreign_message_and_no_loss(harness):
    client = start_rig(harness)
    for _ in range(3):
        assert run(harness, client, samples=["steel small"], impacts=2).result.success
    assert not any(node.intake.strangers for node in harness.nodes)
    harness.run(harness.find(RecorderNode).close)
    assert read_health(harness.recording)["messages_lost"] == "0"
    states = Scan(harness.recording).read_messages(lambda it: it.topic == "/hammer/state")
    campaigns = {bytes(raw.data)[16:32] for raw in states}
    assert len(campaigns) >= 3


class Seen:
    """An operator who only watches, and sees the stranger to the door once it has been named."""

    def __init__(self, publish, end):
        self.releases = []
        self.told = ""
        self._publish, self._end = publish, end

    def follow(self, rig):
        if "/peer speaks on " in rig.campaign.message and not self.told:
            self.told = rig.campaign.message
            self._end()
        elif not self.told:
            self._publish()

    def mount(self, sample, further):
        raise AssertionError

    def put_back(self, refusal):
        raise AssertionError

    def let_go(self, sample, patience):
        self.releases.append(sample)


def make_foreign():
    """Return messages that could deceive a campaign's client."""
    return (
        (interfaces.RELEASE, msg.HammerRelease(sample="EVIL", latest_contact=math.inf)),
        (interfaces.RELEASE, msg.HammerRelease(sample="EVIL", latest_contact=60.0)),
        (interfaces.RECORDER_STATE, msg.RecorderState(recording=True, uri="/evil/session.mcap")),
        *(
            (interfaces.VIRTUAL_IMPACT, msg.VirtualImpact(record=record, faults=["evil"]))
            for record in range(1, 9)
        ),
    )


def test_the_client_of_a_campaign_believes_nobody_else(harness):
    start_rig(harness)
    foreign = make_foreign()
    # Without a lease, as `ros2 topic pub` and a bag have none: a second node's would disarm.
    publishers = {}

    def publish():
        for topic, message in foreign:
            if topic.name not in publishers:
                publishers[topic.name] = harness.peer.create_publisher(
                    topic.type, topic.name, topic.qos
                )
            publishers[topic.name].publish(message)

    def end():
        for publisher in publishers.values():
            harness.run(lambda publisher=publisher: harness.peer.destroy_publisher(publisher))

    operator = Seen(publish, end)
    with CampaignClient() as client:
        client.wait_for_rig(60.0)
        goal = RunCampaign.Goal(samples=["steel small"], impacts=3)
        outcome = client.run(
            goal, operator, longest_pause=30.0
        )  # it arms again: hits are computed
        assert client.run_folder == harness.recording.parent
    assert outcome.success
    assert operator.told
    assert operator.releases == []
    assert {fault for hit in outcome.results.hits for fault in hit.injected_faults} == set()
    harness.run(harness.find(RecorderNode).close)
    sent = {serialize_message(message) for _, message in foreign}
    assert not sent & {bytes(raw.data) for raw in Scan(harness.recording).read_messages()}
    assert read_health(harness.recording)["messages_lost"] == "0"


def test_a_rig_without_a_namespace_does_not_record_another_rig(harness, tmp_path):
    root = harness.record()
    other = harness.add(RecorderNode, namespace="/bench", output=str(tmp_path / "bench.mcap"))
    peer = harness.peer.create_publisher(String, "/bench/temperature", 10)
    harness.wait_until(lambda: peer.get_subscription_count() == 2)
    for node in (root, other):
        harness.run(node.close)
    topics = {it.topic for it in Scan(harness.recording).read_channels()}
    assert "/recorder/state" in topics
    assert {name for name in topics if name.startswith("/bench/")} == {"/bench/temperature"}


COUNT = 150
"""How often; part `foreign` of the bench does it for longer."""


@pytest.mark.parametrize("with_ids", [False, True], ids=["other ids", "ids read from the wire"])
def test_a_stranger_ends_no_node_and_nothing_of_it_is_recorded(harness, tmp_path, with_ids):
    client = start_rig(harness)
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    harness.add(VisualizerNode, output=str(tmp_path / "session.rrd"))
    handle, feedback = begin(harness, client, samples=["steel small"], impacts=1000)
    feedback.wait(lambda messages: messages[-1].impact > 1)
    stranger = harness.run(lambda: Stranger(harness.peer, 7, TOPICS))
    harness.wait_until(lambda: any(stranger.identity.campaign_id))
    harness.run(stranger.begin)
    feedback.wait(lambda messages: "/peer speaks on " in messages[-1].message)
    for number in range(COUNT):
        harness.run(lambda: stranger.publish(with_ids=with_ids))
        if not with_ids:
            harness.run(stranger.ask)
            if number % 5 == 0:
                harness.settle()
    harness.settle()
    assert all(node.is_active for node in harness.nodes)
    harness.run(stranger.end)
    seen = feedback.messages[-1].impact
    arm(harness)
    feedback.wait(lambda messages: messages[-1].impact > seen + 1)
    result = cancel(harness, handle).result
    harness.run(harness.find(RecorderNode).close)
    messages = Scan(harness.recording).read_messages()
    assert {hit.sample for hit in (*result.accepted, *result.rejected)} == {"steel small"}
    assert stranger.list_recorded(messages) == []
    assert read_health(harness.recording)["messages_lost"] == "0"
