"""A campaign begins with the operational check, once a day; a light barrier measures each hit."""

import pytest
from impact_rig_msgs.action import RunCampaign

from impact_rig.analysis.analyze import analyze
from impact_rig.configuration.rig_file import make_check_mass, read_template
from impact_rig.core.given.setup import CONTROL_SAMPLE, PAPER_SETUP
from impact_rig.nodes.campaign_plan import plan_campaign
from impact_rig.nodes.messages import stamp_to_msg
from impact_rig.nodes.result_messages import results_from_msg
from impact_rig.recordings.run import Run
from impact_rig.results.results_file import results_to_json
from impact_rig.results.wire import format_json

from .campaigns import run, start_rig

TABLES = """
[check_mass]
mass = "150.2 g"
[source]
driver = "virtual"
sampling_rate = "500 kHz"  # a busy machine can take no more of a stream in one process
amplitude_scatter = 0.05
[source.impact_speed]
distance = "5 mm"
distance_uncertainty = "10 um"
"""


@pytest.mark.parametrize("mode", ["triggered", "continuous"])
def test_check_mass_and_measured_speeds_are_the_same_live_and_analyzed(harness, tmp_path, mode):
    path = tmp_path / "rig.toml"
    path.write_text(read_template() + TABLES, "utf-8")
    stream = {"mode": mode, "stream_block_size": 50_000}
    client = start_rig(harness, campaign={"rig_file": str(path)}, rig_file=str(path), **stream)
    first, second = (
        run(harness, client, samples=[CONTROL_SAMPLE], impacts=2).result for _ in range(2)
    )
    assert first.success, first.message
    names = [[sample.name for sample in result.samples] for result in (first, second)]
    assert names == [["check mass", CONTROL_SAMPLE], [CONTROL_SAMPLE]]
    check, control = first.samples
    assert check.checks.traced_mass.value == pytest.approx(0.1532, rel=0.01)
    speeds = [hit.impact_speed for hit in first.accepted]
    assert len(set(speeds)) == 4
    assert speeds == pytest.approx([0.0819] * 4, rel=0.2)
    assert all(0.0 < hit.impact_speed_uncertainty < 2e-3 for hit in first.accepted)
    assert control.checks.impact_speed.value == pytest.approx(sum(speeds[2:]) / 2.0)
    live = [
        format_json(results_to_json(results_from_msg(result, {}))) for result in (first, second)
    ]
    analyzed = analyze(Run(harness.recording)).campaigns
    assert [format_json(results_to_json(item.results)) for item in analyzed] == live


def test_the_goals_check_mass_goes_before_the_rig_files():
    goal = RunCampaign.Goal(
        samples=[CONTROL_SAMPLE], impacts=3, check_mass=0.2, check_mass_uncertainty=1e-5
    )
    due = make_check_mass(0.15, 0.0)
    setup = plan_campaign(goal, PAPER_SETUP, (), stamp_to_msg(0), due)
    assert setup.check_sample == "check mass"
    assert list(setup.plan.samples) == ["check mass", CONTROL_SAMPLE]
    assert (setup.samples[0].mass, setup.samples[0].mass_uncertainty) == (0.2, 1e-5)


def test_a_check_mass_whose_hits_fail_ends_the_campaign_soon(harness):
    client = start_rig(harness, source='fault_probability = 1.0\nfaults = "weak_hit"')
    result = run(harness, client, samples=[CONTROL_SAMPLE], impacts=2, check_mass=0.15).result
    assert result.message.startswith("check mass: 3 hits in a row were rejected")
    assert {hit.sample for hit in result.rejected} == {"check mass"}
