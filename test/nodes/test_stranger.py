"""A stranger publishes and asks at random, beside a campaign: it pauses, and nothing is lost.

The longer version is part `foreign` of the bench.
"""

import pytest
from bench.stranger import TOPICS, Stranger
from impact_rig_msgs.srv import Act

from impact_rig.nodes import interfaces
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.nodes.visualizer import VisualizerNode
from impact_rig.recordings.scan import Scan

from .campaigns import begin, cancel, start_rig
from .test_foreign_messages import read_health

COUNT = 150


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
    harness.wait_until(lambda: harness.call(Act, interfaces.ARM_HAMMER).success)
    feedback.wait(lambda messages: messages[-1].impact > seen + 1)
    result = cancel(harness, handle).result
    harness.run(harness.find(RecorderNode).close)
    messages = Scan(harness.recording).read_messages()
    assert {hit.sample for hit in (*result.accepted, *result.rejected)} == {"steel small"}
    assert stranger.list_recorded(messages) == []
    assert read_health(harness.recording)["messages_lost"] == "0"
