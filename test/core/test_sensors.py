"""Sensors: the age of a calibration, what units stand for, plans that cannot be."""

from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.errors import ParameterError
from impact_rig.core.sensors import (
    ChannelPlan,
    ChannelUse,
    Sensitivity,
    Sensor,
    compute_scale,
    normalize_unit,
)
from impact_rig.core.setup import PAPER_SETUP


@pytest.mark.parametrize(
    ("calibrated", "today", "told"),
    [
        ("", "2026-11-21", ""),
        ("2025-11-21", "2026-11-21", ""),
        ("2025-11-20", "2026-11-21", "was calibrated on 2025-11-20, over a year before"),
        ("2024-02-29", "2025-03-01", "over a year before"),
        ("2026-11-22", "2026-11-21", "lies ahead of 2026-11-21"),
    ],
)
def test_a_calibration_holds_for_a_year(calibrated, today, told):
    warning = Sensor("hammer", calibration_date=calibrated).describe_age(today)
    assert told in warning
    assert bool(told) == bool(warning)


def test_each_sensor_is_told_of_with_its_serial_number():
    sensors = (
        Sensor("hammer", serial_number="LW1", calibration_date="2020-01-01"),
        Sensor("specimen", serial_number="LW2", calibration_date="2026-01-01"),
    )
    (told,) = replace(PAPER_SETUP, sensors=sensors).list_calibration_warnings("2026-11-21")
    assert told.startswith("the hammer sensor LW1 was calibrated on 2020-01-01")
    assert PAPER_SETUP.list_calibration_warnings("2026-11-21") == ()


@pytest.mark.parametrize(
    ("unit", "mass", "sensitivity", "scale"),
    [
        ("m/s^2", np.nan, None, 1.0),
        ("g", np.nan, None, 9.80665),
        ("N", 0.5, None, 2.0),
        ("lbf", 2.0, None, 2.2241108),
        ("V", np.nan, Sensitivity(0.01, "g"), 980.665),
        ("V", 0.5, Sensitivity(2.25e-3, "N"), 2 / 2.25e-3),
    ],
)
def test_a_unit_stands_for_an_acceleration(unit, mass, sensitivity, scale):
    assert compute_scale(unit, mass, sensitivity) == pytest.approx(scale, rel=1e-7)


def test_the_spellings_of_instruments_are_known():
    assert {normalize_unit(text) for text in ("m/s²", "m/s2", " m/s^2")} == {"m/s^2"}
    assert {normalize_unit(text) for text in ("gn", "G", "g")} == {"g"}
    assert normalize_unit("Pa") == "Pa"


@pytest.mark.parametrize(
    ("unit", "mass", "told"),
    [
        ("N", np.nan, "needs the hammer's mass"),
        ("V", 0.5, "needs a sensitivity"),
        ("Pa", 0.5, "'Pa' is unknown: a channel is in m/s"),
    ],
)
def test_units_that_give_no_acceleration_are_refused(unit, mass, told):
    with pytest.raises(ParameterError, match=told):
        compute_scale(unit, mass)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: Sensitivity(0.0, "g"), "must not be zero"),
        (lambda: Sensitivity(0.01, "Pa"), "per 'Pa': it must be a voltage per"),
        (lambda: ChannelUse(unit="g", sensitivity=Sensitivity(0.01, "g")), "for channels in V"),
        (lambda: ChannelPlan(columns=("time", "hammer", "time")), "'time' is given twice"),
        (
            lambda: ChannelPlan(columns=("hammer", "hammer", "specimen")),
            "2 columns are the hammer's and 1 the sample's",
        ),
        (lambda: ChannelPlan(columns=("time", "specimen")), "no column has the role 'hammer'"),
        (lambda: ChannelPlan(time_unit="hours"), "'hours' is unknown: it is s, ms, us, ns, min"),
        (lambda: ChannelPlan(time_unit="samples"), "need a sampling rate"),
        (lambda: ChannelPlan(ChannelUse("a"), columns=("hammer",)), "one of the two"),
        (lambda: ChannelPlan(specimen=ChannelUse("b")), "the hammer's is not named"),
        (lambda: ChannelPlan(ChannelUse("a"), ChannelUse("a")), "'a' is the hammer's and"),
        (lambda: ChannelPlan(specimen=ChannelUse(unit="N")), "must be an acceleration"),
    ],
)
def test_what_cannot_be_meant_is_refused(make, told):
    with pytest.raises(ParameterError, match=told):
        make()
