"""A rig in a test: real nodes, a campaign, its truth; and scores of estimators."""

import doctest
import math
import os
import re
import sys
from contextlib import closing
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import scipy.stats
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import CampaignState
from impact_rig_msgs.srv import Act
from rclpy.action import ActionClient
from terminal import Terminal, run_program

from impact_rig import Number, open_run
from impact_rig.core.given.errors import ParameterError
from impact_rig.nodes.interfaces import CAMPAIGN_STATE, PAUSE_CAMPAIGN, RUN_CAMPAIGN
from impact_rig.testing import run_rig, score, score_node, scoring
from impact_rig.testing.harness import Harness

README = Path(__file__).resolve().parent.parent / "README.md"
STEEL, CONTROL = "steel small", "aluminium large"


def test_a_campaign_finds_what_really_happened(virtual_rig):
    results = virtual_rig.campaign([STEEL, CONTROL], impacts=2)
    assert list(results) == [CONTROL, STEEL]
    assert results[STEEL].impacts_accepted == 2
    for hit in results.record.hits:
        assert hit.contact_time == pytest.approx(
            virtual_rig.find_truth(hit).contact_time, rel=0.003
        )
    truth = open_run(virtual_rig.recording).hits[STEEL][0].truth
    assert truth.peak_force == virtual_rig.simulation.strike(STEEL).truth.peak_force


def test_a_node_in_the_rigs_domain_is_scored_against_the_truth(virtual_rig):
    """The rig's own estimator, as anybody's node; its interval here does not hold the truth."""
    assert os.environ["ROS_DOMAIN_ID"] == str(virtual_rig.domain)

    def read(message):
        time = 1.02 * message.contact_time
        ends = 0.99 * time, 1.03 * time
        return message.sample, message.impact, message.attempt, time, *ends

    (found,) = score_node(virtual_rig, "/impact", read, samples=[STEEL], impacts=3)
    assert (found.sample, found.hits, found.failed, found.coverage) == (STEEL, 3, 0, 0.0)
    assert found.bias == pytest.approx(0.02, abs=0.003)
    (deaf,) = score_node(
        virtual_rig, "/impact", lambda _: None, samples=STEEL, impacts=1, patience=0.1
    )
    assert deaf.failed == deaf.hits == 1
    with pytest.raises(ParameterError, match=r"not struck, as \('steel', 1, 1\): they are as"):
        score_node(virtual_rig, "/impact", lambda _: ("steel", 1, 1, 2e-4, 0.0), samples=STEEL)


@pytest.mark.parametrize(
    ("read", "words"),
    [
        (lambda message: message.nonsense, "AttributeError: .*nonsense"),
        (lambda message: (message.sample, 1), "ValueError: not enough values"),
        (
            lambda message: (message.sample, 1, 1, "a", 0.0),
            r"ParameterError: \['a', 0.0\]: it must",
        ),
    ],
)
def test_what_goes_wrong_in_a_reader_is_told(virtual_rig, read, words):
    with pytest.warns(UserWarning, match=f"read raised 1 error, first {words}"):
        (found,) = score_node(virtual_rig, "/impact", read, samples=STEEL, impacts=1, patience=0.1)
    assert found.failed == 1


def test_an_estimator_is_scored_against_the_truth():
    found = score(lambda hit: (hit.truth.contact_time * 1.01, 2e-6), samples=[STEEL], impacts=4)
    assert found[0].bias == pytest.approx(0.01)
    assert found[0].spread == pytest.approx(0.0, abs=1e-12)
    assert found[0].coverage == 1.0
    assert str(found).splitlines()[-1].split() == [
        "steel",
        "small",
        "4",
        "0",
        "1.000",
        "0.000",
        "100.0",
        "39.8",
        "100.0",
    ]
    wrong = score(lambda hit: (hit.truth.contact_time * 1.1, 1e-6), samples=[STEEL], impacts=2)
    assert wrong[0].coverage == 0.0
    with pytest.warns(
        UserWarning, match="raised 2 errors, first AttributeError: .*nonsense.* of s"
    ):
        broken = score(lambda hit: hit.nonsense, samples=STEEL, impacts=2)
    assert (broken[0].failed, math.isnan(broken[0].bias)) == (2, True)
    with pytest.raises(ParameterError, match="no true 'stiffness': it has 'contact_time', "):
        score(np.mean, quantity="stiffness", samples=[STEEL])
    damped = {"quantity": "damping_coefficient", "plant": "dynamics", "impacts": 2}
    (found,) = score(lambda hit: hit.truth.damping_coefficient, samples=STEEL, **damped)
    assert found.bias == 0.0


TRUE = 170e-6  # contact time of the steel sample on the published plant, within 3 µs
AROUND = {
    "a number": (Number(200e-6, 50e-6, 100e-6), 1.0),
    "an uneven number that reaches it by its long end": (
        Number(TRUE + 40e-6, 5e-6, 10e-6, TRUE - 10e-6, TRUE + 45e-6), 1.0
    ),
    "an uneven number that misses it by its short end": (
        Number(TRUE + 20e-6, 15e-6, 30e-6, TRUE + 10e-6, TRUE + 90e-6), 0.0
    ),
    "a number without an upper end": (
        Number(TRUE - 20e-6, 5e-6, 10e-6, TRUE - 25e-6, math.nan), 1.0
    ),
    "both ends": ((TRUE + 40e-6, TRUE - 10e-6, TRUE + 45e-6), 1.0),
    "both ends above it": ((TRUE + 40e-6, TRUE + 10e-6, TRUE + 45e-6), 0.0),
}  # fmt: skip


@pytest.mark.parametrize("kind", AROUND)
def test_an_estimate_may_have_an_interval_of_any_kind(kind):
    estimate, coverage = AROUND[kind]
    (found,) = score(lambda _: estimate, samples=STEEL, impacts=2, plant="published")
    assert (found.failed, found.coverage) == (0, coverage)


@pytest.mark.parametrize(("count", "total"), [(0, 20), (19, 20), (20, 20), (3, 7)])
def test_the_interval_of_a_coverage_is_clopper_and_pearsons(count, total):
    low, high = scoring.compute_part_interval(count, total)
    wanted = scipy.stats.binomtest(count, total).proportion_ci(method="exact")
    assert (low, high) == pytest.approx((wanted.low, wanted.high), abs=1e-9)


@pytest.mark.parametrize("factor", [1e6, 1e-3])
def test_estimates_in_another_unit_are_warned_of(factor):
    with pytest.warns(UserWarning, match=re.escape(f"small are {factor:.2g} times")):
        score(lambda hit: factor * hit.truth.contact_time, samples=STEEL, impacts=1)


@pytest.mark.parametrize(
    "wrong", ["a", [1.0, 2.0, 3.0], np.zeros((2, 2)), {}, True, (1e-4, -1e-6), (1.0, 0.0, 0.9)]
)
def test_what_is_no_estimate_is_named(wrong):
    with pytest.raises(ParameterError, match=r"the estimator's answer to steel small/1 is .*: it"):
        score(lambda _: wrong, samples=STEEL, impacts=1)


def test_what_no_campaign_can_be_is_named(virtual_rig):
    with pytest.raises(ParameterError, match="impacts is 0: it must be a whole number, 1 or more"):
        virtual_rig.campaign(STEEL, impacts=0)
    real = replace(virtual_rig, simulation=None)
    with pytest.raises(ParameterError, match="known on the virtual rig alone"):
        real.find_truth(real.campaign)


BROKEN = """
import psutil

def test_that_fails(virtual_rig):
    virtual_rig.campaign("tin")

def test_after_it(virtual_rig):
    virtual_rig.campaign("steel small", impacts=1)
    (recorder,) = (
        process
        for process in psutil.process_iter(["name", "environ"])
        if process.info["name"] == "recorder"
        and (process.info["environ"] or {}).get("ROS_DOMAIN_ID") == str(virtual_rig.domain)
    )
    recorder.kill()

def test_without_a_recorder(virtual_rig):
    virtual_rig.campaign("steel small", impacts=1)
"""
ENDLESS = """
def test_that_does_not_end(virtual_rig):
    print("it begins")
    virtual_rig.campaign("steel small", impacts=100_000)
"""
VIRTUAL_RIG = """
[hammer]
mass = "100 g"
impact_speed = "10 cm/s"
[samples]
control = "disc"
[[sample]]
name = "disc"
material = "steel"
mass = "100 g"
[source]
driver = "virtual"
plant = "contact"
contact_exponent = 2.0
"""
PYTEST = (sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-rf")


def check_that_nothing_is_left(folder):
    assert str(folder) not in run_program(["ps", "-eo", "args"]).stdout


def test_each_module_of_someone_else_has_a_rig_of_its_own_whatever_becomes_of_it(tmp_path):
    """The example of the README runs beside it in another process."""
    (text,) = re.findall(r"```python\n(def test_.*?)```", README.read_text("utf-8"), re.DOTALL)
    (tmp_path / "test_readme.py").write_text(text, "utf-8")
    (tmp_path / "test_broken.py").write_text(BROKEN, "utf-8")
    parallel = ["-n", "2", "--dist", "loadfile"] if find_spec("xdist") else []
    words = [*parallel, f"--basetemp={tmp_path / 'tmp'}", tmp_path]
    done = run_program([*PYTEST, *words], cwd=tmp_path)
    assert "2 failed, 2 passed" in done.stdout, done.stdout
    assert "the campaign is rejected: unknown sample 'tin'" in done.stdout
    assert "recorder has ended (-9): the rig ends" in done.stdout
    check_that_nothing_is_left(tmp_path)


def test_ctrl_c_in_a_test_ends_its_rig(tmp_path):
    (tmp_path / "test_endless.py").write_text(ENDLESS, "utf-8")
    words = ["-s", f"--basetemp={tmp_path / 'tmp'}", tmp_path]
    with Terminal([*PYTEST, *words], folder=tmp_path) as terminal:
        terminal.wait_for("it begins")
        assert terminal.interrupt() == pytest.ExitCode.INTERRUPTED
    check_that_nothing_is_left(tmp_path)


def test_a_campaign_that_a_test_has_left_in_a_pause_is_ended_by_the_next(virtual_rig, tmp_path):
    with closing(Harness(tmp_path / "no.mcap", virtual_rig.domain)) as harness:
        client = ActionClient(harness.peer, RunCampaign, RUN_CAMPAIGN)
        harness.wait_until(client.server_is_ready)
        states = harness.listen(CAMPAIGN_STATE)
        client.send_goal_async(RunCampaign.Goal(samples=[STEEL], impacts=1000))
        states.wait(lambda got: got[-1].impact > 1)
        harness.call(Act, PAUSE_CAMPAIGN)
        states.wait(lambda got: got[-1].state == CampaignState.PAUSED)
    assert virtual_rig.campaign(STEEL, impacts=1)[STEEL].impacts_accepted == 1


def test_the_example_of_scores_is_true():
    assert doctest.testmod(scoring).failed == 0


def test_a_rig_file_with_a_source_of_its_own_has_its_truth(tmp_path):
    """A script runs it: no pytest, no folder of its own."""
    path = tmp_path / "rig.toml"
    path.write_text(VIRTUAL_RIG)
    with run_rig(path, seed=5) as rig:
        (hit,) = rig.campaign("disc", impacts=1).record.hits
        recorded = open_run(rig.recording).hits["disc"][0].truth
        assert rig.find_truth(hit).contact_time == recorded.contact_time
        assert rig.find_truth(hit).exponent == 2.0
    assert not rig.folder.exists()
