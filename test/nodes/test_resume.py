"""A campaign that ended goes on where its run stands; a trial hit is in no result."""

import signal

import pytest
from action_msgs.msg import GoalStatus
from impact_rig_msgs.action import RunCampaign

from impact_rig.analysis.analyze import analyze
from impact_rig.configuration.processes import RESULTS_NAME
from impact_rig.core.given.errors import FileError
from impact_rig.nodes import interfaces
from impact_rig.nodes.campaign_client import CampaignClient
from impact_rig.nodes.campaign_plan import read_newest_campaign
from impact_rig.nodes.result_messages import hit_results_from_msg
from impact_rig.recordings.contents import inspect_run
from impact_rig.recordings.run import Run
from impact_rig.results.results_file import results_to_json
from impact_rig.results.wire import format_json
from impact_rig.status.states import Step

from .campaigns import Onlooker, begin, cancel, run, start_rig, wait_for_impact

SAMPLES = ["steel small", "brass small"]
IMPACTS = 6
RIG = {
    "hammer": {"swing_time": 0.02},
    "accelerometer": {"trigger_timeout": 0.1, "source": "fault_probability = 0.1"},
    "estimator": {},
    "campaign": {"verdict_timeout": 2.0},
    "recorder": {},
}
START_PATIENCE = 60.0


def test_a_cancelled_campaign_goes_on_on_the_same_rig(harness):
    client = start_rig(harness)
    setups, states = map(harness.listen, (interfaces.SETUP, interfaces.HAMMER_STATE))
    handle, feedback = begin(harness, client, samples=SAMPLES, impacts=IMPACTS)
    wait_for_impact(harness, feedback, 2)
    answer = cancel(harness, handle)
    assert answer.status == GoalStatus.STATUS_CANCELED
    states.wait(lambda got: not got[-1].armed)
    first = answer.result
    assert first.setup.campaign_id == setups.messages[-1].campaign_id
    second = run(harness, client, resumed=first.setup).result
    assert second.success, second.message
    before, after = (list(map(hit_results_from_msg, it.accepted)) for it in (first, second))
    assert after[: len(before)] == before
    struck = [(hit.sample, hit.impact) for hit in second.accepted]
    assert struck == [(name, number) for name in SAMPLES for number in range(1, IMPACTS + 1)]


@pytest.fixture
def power(start_process, tmp_path):
    """Return functions that start the nodes of a rig on one run, and kill them all at once."""
    processes = []

    def on():
        for name, parameters in RIG.items():
            extra = {"output": str(tmp_path / "session.mcap")} if name == "recorder" else {}
            processes.append(start_process(name, **parameters, **extra))

    def off():
        for process in processes:
            process.process.send_signal(signal.SIGKILL)
        for process in processes:
            process.wait()
        processes.clear()

    return on, off


class PowerCutError(Exception):
    pass


def test_after_a_power_cut_the_run_has_every_hit_once_and_analyze_says_the_same(
    harness, power, tmp_path
):
    on, off = power
    verdicts = harness.listen(interfaces.IMPACT)
    goal = RunCampaign.Goal(samples=SAMPLES, impacts=IMPACTS)

    killed = []

    def cut(rig):
        campaign = rig.campaign
        if not killed and campaign.sample == SAMPLES[1] and campaign.state is Step.STRIKING:
            off()
            killed.append(True)

    def check():
        if killed:
            raise PowerCutError

    on()
    with CampaignClient(check=check) as client:
        client.wait_for_rig(START_PATIENCE)
        with pytest.raises(PowerCutError):
            client.run(goal, Onlooker(cut))
    on()
    with CampaignClient() as client:
        client.wait_for_rig(START_PATIENCE)
        resumed = read_newest_campaign(tmp_path)
        client.check_run(tmp_path)
        goal = RunCampaign.Goal(resumed=resumed)
        outcome = client.run(goal, Onlooker(lambda _: None))
    assert outcome.success, outcome.message
    off()
    hits = outcome.results.hits
    assert len({hit.record for hit in hits}) == len(hits)
    # Of every verdict that was published, also before the cut, the hit is on the disk.
    seen = {(verdict.record, str(verdict.contact_time)) for verdict in verdicts.messages}
    assert len(seen) >= IMPACTS
    assert seen <= {(hit.record, str(hit.contact_time)) for hit in hits}
    accepted = [(hit.sample, hit.impact) for hit in hits if hit.accepted]
    assert accepted == [(name, number) for name in SAMPLES for number in range(1, IMPACTS + 1)]
    assert len(list(tmp_path.glob("session*.mcap"))) == 2
    (campaign,) = analyze(Run(tmp_path)).campaigns
    live = format_json(results_to_json(outcome.results))
    assert (tmp_path / RESULTS_NAME).read_text() == live
    assert format_json(results_to_json(campaign.results)) == live


def count_verdicts(path):
    """Return how many verdicts can be looked at, those of trials among them."""
    topic = inspect_run(Run(path)).topics.get("/impact")
    return topic.messages if topic else 0


def test_a_trial_hit_is_recorded_and_does_not_count(harness):
    client = start_rig(harness)
    verdicts = harness.listen(interfaces.IMPACT)
    trial = run(harness, client, samples=SAMPLES[:1], impacts=1, trial=True).result
    assert trial.success, trial.message
    assert verdicts.wait_for_count(1)[0].hammer_peak > 0.0
    with pytest.raises(FileError, match="holds no campaign that could go on"):
        read_newest_campaign(harness.recording)

    counted = run(harness, client, samples=SAMPLES[:1], impacts=2).result
    assert counted.success, counted.message
    campaign = read_newest_campaign(harness.recording)
    assert campaign.campaign_id == counted.setup.campaign_id
    again = run(harness, client, samples=SAMPLES[:1], impacts=1, trial=True).result
    assert again.success, again.message

    # The last verdict comes to the recorder by a way of its own.
    harness.wait_until(lambda: count_verdicts(harness.recording) == 4)
    read = Run(harness.recording)
    (found,) = analyze(read).campaigns
    assert [hit.record for hit in found.results.hits] == [2, 3]
    contents = inspect_run(read)
    assert [hit.record for hit in contents.hits if hit.blocks] == [2, 3]
