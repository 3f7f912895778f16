"""A sensitivity comes with an uncertainty that holds what it promises.

How many times larger one trace is than another: on traces whose ratio is known.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.estimates.calibration import (
    LARGEST_MISFIT,
    CalibrationMethod,
    HitFit,
    estimate_sensitivity,
    fit_hit,
)
from impact_rig.core.given.errors import NotDeterminedError, ParameterError
from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.sensors import Sensor
from impact_rig.core.given.setup import PAPER_SETUP, AnalysisSettings
from impact_rig.core.hit.judging import judge_hit

from ..blocks import make_record

RATE = 1e6
SETTINGS = AnalysisSettings()


def make_pulse(delay=0.0, duration=200e-6):
    """Return a versed-sine of height 1 over 2 ms, beginning at 0.3 ms."""
    time = np.arange(2000) / RATE - 0.3e-3 - delay
    inside = (time >= 0) & (time <= duration)
    return np.where(inside, np.sin(np.pi * time / duration) ** 2, 0.0)


def judge(hammer, specimen):
    record = make_record(hammer, specimen, pulse_index=330, full_scale=0.0, rate=RATE)
    return judge_hit(replace(record, stamp=7), SETTINGS)


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
    assert found.flaw is None
    assert found.stamp == 7
    # Rounding: offsets may be 5000 times as large as the trace.
    assert found.ratio == pytest.approx(ratio, rel=1e-9)
    assert found.misfit < 1e-6
    assert fit_hit(hit, "hammer", 1.0).ratio == pytest.approx(1.0 / ratio, rel=1e-9)


def test_a_delay_that_is_let_pass_changes_the_ratio_by_less_than_the_square_of_its_misfit():
    checked = 0
    for delay in np.linspace(0.2e-6, 12e-6, 20):
        found = fit_hit(judge(1000 * make_pulse(), 1000 * make_pulse(delay)), "specimen", 1.0)
        if found.flaw:
            assert found.misfit > LARGEST_MISFIT
            assert "misfit" in found.flaw
        else:
            checked += 1
            assert abs(found.ratio - 1.0) <= found.misfit**2
    assert 0 < checked < 20


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


FORCE = Sensor("hammer", "force", "N", 2.25e-3)
HAMMER = Sensor("hammer", "acceleration", "g", -0.01)
SPECIMEN = Sensor("specimen", "acceleration", "g", 0.01)
MASSES = replace(PAPER_SETUP, hammer_mass=0.1, hammer_mass_uncertainty=0.001)


def make_fits(*ratios, misfit=0.0):
    return [
        HitFit(HitLabel("block", number), 0, ratio, misfit)
        for number, ratio in enumerate(ratios, start=1)
    ]


def find_contributions(calibration):
    return {line.source: line.contribution for line in calibration.ratio.budget}


def test_the_new_sensitivity_is_the_old_one_times_the_ratio():
    method = CalibrationMethod("hammer", reference_uncertainty=1e-9)
    found = estimate_sensitivity(make_fits(1.01, 1.02, 1.03), method, MASSES, HAMMER)
    assert found.ratio.value == pytest.approx(1.02)
    assert found.sensitivity == pytest.approx(-0.0102)
    assert found.hits == 3
    assert not found.is_reversed
    # Student's t of two degrees of freedom: 4.303; of three hits s / sqrt(3).
    assert find_contributions(found) == {"scatter of the hits": pytest.approx(0.01 / math.sqrt(3))}
    assert found.ratio.expanded == pytest.approx(4.303 * 0.01 / math.sqrt(3), rel=1e-3)


@pytest.mark.parametrize(
    ("ratios", "told"),
    [
        ((0.9, 1.1, 0.9, 1.1), "ratios are 0.9 to 1.1, and should differ by a few per cent"),
        ((1.7, 1.7, 1.7), "ratio of 1.7, where 1 is expected.*begin with -17$"),
        ((-0.5, -0.5, -0.5), "ratio of -0.5, where 1 is expected"),
    ],
)
def test_ratios_that_are_of_no_sensor_are_refused(ratios, told):
    with pytest.raises(NotDeterminedError, match=told):
        estimate_sensitivity(make_fits(*ratios), CalibrationMethod("hammer"), MASSES, HAMMER)


def test_what_is_known_otherwise_is_in_the_budget():
    method = CalibrationMethod("hammer", 0.2, 0.002, 0.005)
    found = estimate_sensitivity(make_fits(1.0, 1.0, 1.0, misfit=0.04), method, MASSES, HAMMER)
    assert find_contributions(found) == {
        "known mass": pytest.approx(0.01),
        "mass of the hammer": pytest.approx(0.01),
        "sensitivity of the reference": pytest.approx(0.005),
        "misfit of the traces": pytest.approx(0.0016 / math.sqrt(3)),
    }
    assert found.remarks == ()
    assert math.isinf(found.ratio.degrees_of_freedom)


def test_the_hammers_mass_cancels_out_where_its_force_is_measured():
    method = CalibrationMethod("hammer", 0.2, 0.002, 0.005)
    found = estimate_sensitivity(make_fits(1.0, 1.0, 1.0), method, MASSES, FORCE)
    assert set(find_contributions(found)) == {"known mass", "sensitivity of the reference"}
    reverse = replace(method, channel="specimen")
    measured = replace(MASSES, sensors=(FORCE,))
    found = estimate_sensitivity(make_fits(1.0, 1.0, 1.0), reverse, measured, SPECIMEN)
    assert set(find_contributions(found)) == {"known mass", "sensitivity of the reference"}
    found = estimate_sensitivity(make_fits(1.0, 1.0, 1.0), reverse, MASSES, SPECIMEN)
    assert "mass of the hammer" in find_contributions(found)


def test_what_is_not_stated_is_assumed_and_told():
    method = CalibrationMethod("hammer", 0.2)
    setup = replace(MASSES, hammer_mass_uncertainty=0.0)
    found = estimate_sensitivity(make_fits(1.0, 1.01, 1.02), method, setup, HAMMER)
    (remark,) = found.remarks
    assert remark == (
        "assumed is the reference within 3 % and the known mass within 0.5 % and the mass of the"
        " hammer within 0.5 %, standard, since nothing states it"
    )
    assert find_contributions(found) == {
        "scatter of the hits": pytest.approx(0.01 / math.sqrt(3)),
        "sensitivity of the reference, assumed": pytest.approx(0.0303),
        "known mass, assumed": pytest.approx(0.00505),
        "mass of the hammer, assumed": pytest.approx(0.00505),
    }


def test_force_is_mass_times_acceleration():
    assert CalibrationMethod("hammer").compute_factor(MASSES) == 1.0
    assert CalibrationMethod("hammer", 0.25).compute_factor(MASSES) == pytest.approx(2.5)
    assert CalibrationMethod("specimen", 0.25).compute_factor(MASSES) == pytest.approx(0.4)
    with pytest.raises(ParameterError, match=r"mass of the hammer is not known"):
        CalibrationMethod("hammer", 0.25).compute_factor(replace(MASSES, hammer_mass=math.nan))


@pytest.mark.parametrize(
    ("values", "told"),
    [
        (("anvil",), "sensor under test is 'anvil'"),
        (("hammer", -1.0), "known mass is -1.0 kg"),
        (("hammer", 1.0, 2.0), "must be less than the mass"),
        (("hammer", math.nan, 0.0, 0.75), "uncertainty of the reference is 0.75"),
    ],
)
def test_impossible_numbers_are_refused(values, told):
    with pytest.raises(ParameterError, match=told):
        CalibrationMethod(*values)
