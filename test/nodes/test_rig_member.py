"""Another node of the rig, as the hammer sees it: alive, silent, or gone."""

from typing import Any

from impact_rig_msgs.msg import CampaignState, RecorderState
from impact_rig_msgs.srv import JoinCampaign

from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.nodes import interfaces
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.identity import Identity, make_id
from impact_rig.nodes.messages import setup_to_msg, stamp_to_msg
from impact_rig.nodes.rig_member import RigMember
from impact_rig.nodes.rig_node import RigNode


class ListeningNode(RigNode):
    silent = 0  # publishers that the middleware calls so

    def __init__(self, topic: interfaces.Topic, **options: Any) -> None:
        super().__init__("listening", **options)
        self.recorder = RigMember(self, "recorder", topic)

    def listen(self, topic, callback, *, on_liveliness=None) -> Any:
        def keep(status: Any) -> None:
            if on_liveliness:
                on_liveliness(status)
            self.silent = status.not_alive_count

        return super().listen(topic, callback, on_liveliness=keep)


def test_a_node_of_this_process_is_alive_while_it_is_there(harness, monkeypatch):
    """The middleware calls it silent as soon as its lease ends."""
    monkeypatch.setattr(interfaces, "LEASE", 0.05)
    topic = interfaces.RECORDER_STATE
    node = harness.add(lambda **options: ListeningNode(topic, **options))
    publisher = harness.advertise(topic)
    publisher.publish(RecorderState())
    harness.wait_until(lambda: node.silent == 1)
    assert not node.recorder.is_gone
    harness.peer.destroy_publisher(publisher)
    harness.wait_until(lambda: node.recorder.is_gone)


def test_a_replay_of_its_states_does_not_keep_it_alive(harness):
    topic = interfaces.RECORDER_STATE
    recorder = harness.add(lambda **options: ListeningNode(topic, **options)).recorder
    assert not recorder.describe_loss()
    publisher = harness.advertise(topic)
    publisher.publish(RecorderState(recording=True, uri="a.mcap"))
    harness.wait_until(lambda: recorder.state is not None)
    assert not recorder.is_gone
    replay = harness.peer.create_publisher(topic.type, topic.name, topic.qos)
    replay.publish(RecorderState(recording=True, uri="b.mcap"))
    harness.peer.destroy_publisher(publisher)
    harness.wait_until(lambda: recorder.is_gone)
    assert recorder.state.uri == "a.mcap"


def test_a_campaign_that_is_silent_for_a_lease_binds_no_hammer(harness, monkeypatch):
    """A hammer that stood still at its end has not heard of that."""
    hammer = harness.add(HammerNode)
    states = harness.advertise(interfaces.CAMPAIGN_STATE)
    first, second = Identity(make_id()), Identity(make_id())

    def join(identity):
        setup = identity.fill(setup_to_msg(PAPER_SETUP, stamp_to_msg(7)))
        name = interfaces.make_join_name("hammer")
        return harness.call(JoinCampaign, name, JoinCampaign.Request(setup=setup))

    assert join(first).success
    states.publish(first.fill(CampaignState(state=CampaignState.COUNTING)))
    harness.wait_until(lambda: hammer._is_bound)
    assert "takes part in a campaign that goes on" in join(second).message
    monkeypatch.setattr(interfaces, "LEASE", 0.0)
    assert join(second).success
