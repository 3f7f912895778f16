"""How many times larger one trace is than another: on traces whose ratio is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.calibration.trace_fit import LARGEST_MISFIT, fit_hit, fit_traces
from impact_rig.core.hits.hit import judge_hit
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.record import HitLabel, Record, Trace

RATE = 1e6
SETTINGS = AnalysisSettings()


def make_pulse(delay=0.0, duration=200e-6):
    """Return a versed-sine of height 1 over 2 ms, beginning at 0.3 ms."""
    time = np.arange(2000) / RATE - 0.3e-3 - delay
    inside = (time >= 0) & (time <= duration)
    return np.where(inside, np.sin(np.pi * time / duration) ** 2, 0.0)


def judge(hammer, specimen, **hammer_facts):
    record = Record(
        HitLabel("block"), RATE, Trace(hammer, **hammer_facts),
        None if specimen is None else Trace(specimen), pulse_index=330, stamp=7,
    )  # fmt: skip
    return judge_hit(record, SETTINGS)


@given(
    ratio=st.floats(0.01, 100.0) | st.floats(-100.0, -0.01),
    height=st.floats(1.0, 1e5),
    offsets=st.tuples(st.floats(-50, 50), st.floats(-50, 50)),
)
def test_the_ratio_of_two_like_traces_is_found_whatever_their_height_and_offset(
    ratio, height, offsets
):
    pulse = height * make_pulse()
    hit = judge(pulse + offsets[0], ratio * pulse + offsets[1])
    found = fit_hit(hit, "specimen", 1.0)
    assert found.flaw == ""
    assert found.stamp == 7
    # Rounding: offsets may be 5000 times as large as the trace.
    assert found.fit.ratio == pytest.approx(ratio, rel=1e-9)
    assert found.fit.misfit < 1e-6
    assert fit_hit(hit, "hammer", 1.0).fit.ratio == pytest.approx(1.0 / ratio, rel=1e-9)


def test_the_trace_under_test_is_held_against_what_it_should_be():
    # Struck by 0.1 kg, a body of 0.25 kg is accelerated 2.5 times less.
    hit = judge(1000 * make_pulse(), 400 * make_pulse())
    assert fit_hit(hit, "hammer", 0.25 / 0.1).fit.ratio == pytest.approx(1.0)
    assert fit_hit(hit, "specimen", 0.1 / 0.25).fit.ratio == pytest.approx(1.0)


def test_a_delay_that_is_let_pass_changes_the_ratio_by_less_than_the_square_of_its_misfit():
    checked = 0
    for delay in np.linspace(0.2e-6, 12e-6, 20):
        found = fit_hit(judge(1000 * make_pulse(), 1000 * make_pulse(delay)), "specimen", 1.0)
        if found.flaw:
            assert found.fit.misfit > LARGEST_MISFIT
            assert "misfit" in found.flaw
        else:
            checked += 1
            assert abs(found.fit.ratio - 1.0) <= found.fit.misfit**2
    assert 0 < checked < 20


def test_noise_that_is_let_pass_changes_the_ratio_by_less_than_the_square_of_its_misfit():
    rng = np.random.default_rng(3)
    fits = [
        fit_traces(make_pulse()[300:501], make_pulse()[300:501] + 0.02 * rng.normal(size=201))
        for _ in range(400)
    ]
    misfit = np.mean([fit.misfit for fit in fits])
    bias = abs(np.mean([fit.ratio for fit in fits]) - 1.0)
    assert 0.03 < misfit < 0.07
    # Of the mean: the scatter of one is misfit / sqrt(201).
    assert bias < misfit**2 + 3 * misfit / np.sqrt(201 * 400)


def test_misfit_and_linearity_are_those_of_the_line():
    # By hand: the best line over (0, 1, 2, 3) for (0, 1, 2, 7) has the slope 2.2.
    fit = fit_traces(np.array([0.0, 1.0, 2.0, 7.0]), np.array([0.0, 1.0, 2.0, 3.0]))
    assert fit.ratio == pytest.approx(2.2)
    correlation = np.corrcoef([0, 1, 2, 7], [0, 1, 2, 3])[0, 1]
    assert fit.misfit == pytest.approx(np.sqrt(1 - correlation**2))
    # The line is 2.2 x - 0.8; it misses most at x = 2: 3.6 where 2 stands.
    assert fit.linearity == pytest.approx(1.6 / 7)


@pytest.mark.parametrize(
    ("hammer", "specimen", "told"),
    [
        (1000 * make_pulse(), None, "was not measured"),
        (1000 * make_pulse(), np.zeros(2000), "the sample channel shows no signal"),
        (1000 * make_pulse(), 1000 * make_pulse(0.1e-3), "do not show the same"),
    ],
)
def test_a_hit_that_says_nothing_is_named_with_its_flaw(hammer, specimen, told):
    found = fit_hit(judge(hammer, specimen), "specimen", 1.0)
    assert told in found.flaw


def test_a_weak_hit_and_a_double_hit_are_as_good_as_others():
    pulse = 1000 * (make_pulse() + 0.5 * make_pulse(0.6e-3))
    hit = judge(pulse, 3 * pulse, full_scale=50_000.0)
    assert {item.reason.value for item in hit.rejections} == {"weak", "double_hit"}
    found = fit_hit(hit, "specimen", 1.0)
    assert found.flaw == ""
    assert found.fit.ratio == pytest.approx(3.0)


def test_an_overloaded_hit_is_not_used():
    pulse = 1000 * make_pulse()
    hit = judge(np.clip(pulse, 0, 700), np.clip(pulse, 0, 700), full_scale=700.0)
    assert "at the rail of 700 m/s^2" in fit_hit(hit, "specimen", 1.0).flaw
