"""Who holds the hammer by hand sees a stop at once, and what is struck after it does not count."""

import threading
import time

import pytest
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.srv import Act

from impact_rig.analysis.analyze import analyze
from impact_rig.configuration.rig_file import read_template
from impact_rig.core.given.findings import Finding, Reason
from impact_rig.core.given.records import DISARMED
from impact_rig.nodes import interfaces
from impact_rig.nodes.campaign_client import CampaignClient
from impact_rig.recordings.run import Run
from impact_rig.status.states import Step

from .campaigns import start_rig

SWING = 3.0
"""When the hammer would strike [s]: a stop after a moment is long before it."""


class Person:
    """Notes what is asked of the person who holds the hammer, and when."""

    def __init__(self):
        self.asked = threading.Event()
        self.held_back = threading.Event()
        self.paused = threading.Event()
        self.reason, self.seen_at = "", 0.0

    def follow(self, rig):
        if rig.campaign.state is Step.PAUSED and "is not armed" in rig.campaign.message:
            self.paused.set()

    def let_go(self, sample, patience):
        self.asked.set()

    def hold_back(self, reason):
        self.reason, self.seen_at = reason, time.monotonic()
        self.held_back.set()


@pytest.fixture
def rig(harness, tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(f'{read_template()}\n[holder]\ndriver = "manual"\n')
    start_rig(harness, hammer={"rig_file": str(path), "swing_time": SWING})


@pytest.mark.parametrize("service", [interfaces.EMERGENCY_STOP, interfaces.DISARM_HAMMER])
def test_a_stop_withdraws_the_request_at_once_and_the_hit_is_rejected_by_name(
    rig, harness, service
):
    person, outcomes = Person(), []
    with CampaignClient() as client:
        client.wait_for_rig(60.0)
        goal = RunCampaign.Goal(samples=["steel small"], impacts=1)
        running = threading.Thread(target=lambda: outcomes.append(client.run(goal, person)))
        running.start()
        assert person.asked.wait(60.0)
        harness.call(Act, service)
        stopped_at = time.monotonic()
        assert person.held_back.wait(10.0)
        assert person.seen_at - stopped_at < 0.3
        # Long before the contact: a swing that does not count is not waited for.
        assert person.paused.wait(10.0)
        assert time.monotonic() - stopped_at < SWING
        harness.set_parameter("campaign", "pause_timeout", 0.01)
        running.join()
    assert person.reason in ("emergency stop", "disarmed by an operator")
    (hit,) = outcomes[0].results.hits
    assert not hit.accepted
    assert hit.reasons == (Finding(Reason.DISARMED, f"{DISARMED}: {person.reason}"),)
    harness.change_state("recorder", "deactivate")
    (analyzed,) = analyze(Run(harness.recording)).campaigns[-1].results.hits
    assert analyzed.reasons == hit.reasons
