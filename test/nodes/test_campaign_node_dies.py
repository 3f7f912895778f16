"""The campaign node is killed: the hammer is disarmed, and with a new one the campaign goes on."""

import signal

from impact_rig_msgs.msg import HammerState

from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.client import CampaignClient, CampaignGoal
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.hammer import HammerNode

SAMPLES = ("steel small", "brass small")
IMPACTS = 4
DEATHS = {("steel small", 2), ("brass small", 0)}
"""After how many accepted hits of which sample the node is killed."""


class Attendant:
    """Kills the campaign node now and then, and starts it again; keeps what it was told."""

    def __init__(self, start_process):
        self._start = lambda: start_process("campaign", rig_file="''")
        self._node = self._start()
        self._left = set(DEATHS)
        self.told = []

    def follow(self, feedback):
        self.told.append(feedback.message)
        place = (feedback.sample, feedback.impact)
        if place in self._left:
            self._left.remove(place)
            self._node.send_signal(signal.SIGKILL)
            self._node.wait()
            self._node = self._start()


def test_it_goes_on_where_it_was_nothing_twice_and_nothing_lost(
    harness, start_process, ros_domain, monkeypatch
):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    harness.add(HammerNode, swing_time=0.05, require_recorder=False)
    harness.add(AccelerometerNode, required_subscribers="estimator", trigger_timeout=0.2)
    harness.add(EstimatorNode)
    states = harness.listen(interfaces.HAMMER_STATE)
    releases = harness.listen(interfaces.RELEASE)
    attendant = Attendant(start_process)
    with CampaignClient() as client:
        client.wait_for_rig(60.0)
        outcome = client.run(CampaignGoal(samples=SAMPLES, impacts=IMPACTS), attendant)
    assert outcome.success, outcome.message
    struck = [(hit.sample, hit.impact) for hit in outcome.results.hits]
    assert struck == [(name, impact) for name in SAMPLES for impact in range(1, IMPACTS + 1)]
    released = [message.record for message in releases.messages]
    assert len(released) == len(set(released))
    losses = [state for state in states.messages if state.disarmed_by == HammerState.LOSS]
    assert all("campaign" in state.message for state in losses)
    assert [message for message in attendant.told if "campaign node" in message]
