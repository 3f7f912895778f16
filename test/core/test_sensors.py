"""A calibration that is too old is named on the day on which the sensor is used."""

from dataclasses import replace

import pytest

from impact_rig.core.sensors import Sensor
from impact_rig.core.setup import PAPER_SETUP


@pytest.mark.parametrize(
    ("calibrated", "today", "told"),
    [
        ("", "2026-11-21", ""),
        ("2026-03-01", "2026-11-21", ""),
        ("2025-11-21", "2026-11-21", ""),
        ("2025-11-20", "2026-11-21", "was calibrated on 2025-11-20, over a year before"),
        ("2024-02-29", "2025-02-28", ""),
        ("2024-02-29", "2025-03-01", "over a year before"),
        ("2023-02-28", "2024-02-29", "over a year before"),
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


def test_a_sensor_says_what_is_known_of_it():
    assert Sensor("hammer").describe() == "acceleration"
    full = Sensor("hammer", "force", "N", 2.25e-3, 2200.0, "SN 7", "2026-03-01")
    assert full.describe() == (
        "force, 2.25 mV per N, up to 2200 N, serial number SN 7, calibrated 2026-03-01"
    )
