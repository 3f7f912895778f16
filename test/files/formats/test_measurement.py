"""A channel keeps its file's numbers, and refuses what cannot be meant."""

import math
from pathlib import Path

import numpy as np
import pytest

from impact_rig.core.given.errors import FileError, ParameterError
from impact_rig.files.measurement import MeasuredChannel, Measurement
from impact_rig.files.times import SAMPLES, compute_rounding, find_time_unit, round_rate


@pytest.mark.parametrize("rate", [3.0, 44100.0, 51200.0, 2.5e6])
@pytest.mark.parametrize("digits", [6, 17])
def test_usual_rates_come_back_from_few_digits_of_their_step(rate, digits):
    step = float(f"{1.0 / rate:.{digits - 1}e}")
    assert round_rate(step, compute_rounding(step, digits)) == rate


@pytest.mark.parametrize(
    ("name", "unit", "found"),
    [
        ("Time", "sec", "s"), ("Second", "", "s"), ("TIME", "", ""), ("Time", "msec", "ms"),
        ("X", "ms", "ms"), ("t/ms", "", "ms"), ("time_us", "", "us"), ("Zeit / µs", "", "us"),
        ("Time", "Microseconds", "us"), ("t", "min", "min"), ("Sequence", "", SAMPLES),
    ],
)  # fmt: skip
def test_the_unit_of_times_is_in_their_heading(name, unit, found):
    assert find_time_unit(name, unit) == found


@pytest.mark.parametrize(
    ("start", "stamp"),
    [(0.0, 1_683_293_990_887_019_931), (-0.5, 1_683_293_990_387_019_931), (1e300, 0), (-1e300, 0)],
)
def test_the_first_point_has_a_date_where_that_can_be_meant(start, stamp):
    channel = MeasuredChannel("a", np.zeros(2), 1.0, "", start, 1_683_293_990_887_019_931)
    assert channel.stamp == stamp
    assert MeasuredChannel("a", np.zeros(2), 1.0, "", start).stamp == 0


@pytest.mark.parametrize("recorded_at", [-1, 1, 10**18 // 4, 2**31 * 10**9, 2**63])
def test_a_date_of_a_clock_that_was_never_set_is_none(recorded_at):
    assert MeasuredChannel("a", np.zeros(2), recorded_at=recorded_at).recorded_at == 0


@pytest.mark.parametrize(
    ("values", "rate", "start", "told"),
    [
        (np.zeros((2, 2)), 1.0, 0.0, "shape"),
        (np.zeros(2), -1.0, 0.0, "sampling rate is -1.0 Hz"),
        (np.zeros(2), 1.0, math.nan, "starts at nan s"),
    ],
)
def test_what_is_no_channel_is_refused(values, rate, start, told):
    with pytest.raises(ParameterError, match=rf"channel 'a'.*{told}"):
        MeasuredChannel("a", values, rate, "", start)


def test_a_measurement_of_nothing_is_refused():
    with pytest.raises(FileError, match=r"hit\.tdms holds no channel"):
        Measurement(Path("hit.tdms"), ())
