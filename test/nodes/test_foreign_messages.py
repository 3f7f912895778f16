"""What is not of a campaign changes nothing in it, in its recording and for its client."""

import mcap.reader
import pytest
from std_msgs.msg import String

from impact_rig.nodes.recorder import RecorderNode
from impact_rig.nodes.visualizer import VisualizerNode
from impact_rig.recordings.scan import Scan

from .campaigns import begin, cancel, run, start_rig, wait_for_impact
from .stranger import TOPICS, Stranger


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
"""How often."""


@pytest.mark.parametrize("with_ids", [False, True], ids=["other ids", "ids read from the wire"])
def test_a_stranger_ends_no_node_and_nothing_of_it_is_recorded(harness, tmp_path, with_ids):
    client = start_rig(harness)
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    harness.add(VisualizerNode, output=str(tmp_path / "session.rrd"))
    handle, feedback = begin(harness, client, samples=["steel small"], impacts=1000)
    wait_for_impact(harness, feedback, 2)
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
    wait_for_impact(harness, feedback, seen + 2)
    result = cancel(harness, handle).result
    harness.run(harness.find(RecorderNode).close)
    messages = Scan(harness.recording).read_messages()
    assert {hit.sample for hit in (*result.accepted, *result.rejected)} == {"steel small"}
    assert stranger.list_recorded(messages) == []
    assert read_health(harness.recording)["messages_lost"] == "0"
