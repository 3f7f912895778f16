"""Hits measured elsewhere become records; what does not fit is named with file and value."""

from pathlib import Path

import numpy as np
import pytest

from impact_rig.core.errors import ParameterError, SignalError
from impact_rig.core.signals.record import HitLabel
from impact_rig.recording.traces import TraceFormat, find_scale, read_trace

DATA = Path(__file__).parents[1] / "data"
LABEL = HitLabel("brass", 1, 2, 3)
COUNT = 40
TIME = 0.25 + np.arange(COUNT) * 4e-7
HAMMER = np.sin(np.arange(COUNT))
SPECIMEN = np.cos(np.arange(COUNT))


@pytest.fixture
def save(tmp_path):
    """Return a function that writes columns and returns the path."""

    def write(*columns) -> Path:
        np.save(tmp_path / "hit.npy", np.array(columns))
        return tmp_path / "hit.npy"

    return write


def test_three_columns_are_time_hammer_and_sample(save):
    record = read_trace(save(TIME, HAMMER, SPECIMEN), LABEL)
    assert record.label == LABEL
    assert record.sampling_rate == pytest.approx(2.5e6, rel=1e-8)
    assert np.array_equal(record.hammer.acceleration, HAMMER)
    assert np.array_equal(record.specimen.acceleration, SPECIMEN)
    assert record.pulse_index is None
    assert record.triggered


def test_two_columns_are_time_and_hammer(save):
    record = read_trace(save(TIME, HAMMER), LABEL)
    assert record.specimen is None
    assert np.array_equal(record.hammer.acceleration, HAMMER)


def test_a_given_rate_stands_in_for_time(save):
    layout = TraceFormat(sampling_rate=51_200.0)
    alone = read_trace(save(HAMMER), LABEL, layout)
    assert (alone.sampling_rate, alone.specimen) == (51_200.0, None)
    both = read_trace(save(HAMMER, SPECIMEN), LABEL, layout)
    assert np.array_equal(both.specimen.acceleration, SPECIMEN)


def test_roles_pick_columns_in_any_order(save):
    layout = TraceFormat(columns=("specimen", "skip", "time", "skip", "hammer"))
    record = read_trace(save(SPECIMEN, HAMMER * np.nan, TIME, TIME, HAMMER), LABEL, layout)
    assert np.array_equal(record.hammer.acceleration, HAMMER)
    assert np.array_equal(record.specimen.acceleration, SPECIMEN)


def test_scales_make_accelerations_of_other_units(save):
    layout = TraceFormat(
        hammer_scale=find_scale("N", mass=0.5),
        specimen_scale=-find_scale("g"),
        hammer_full_scale=30.0,
    )
    record = read_trace(save(TIME, HAMMER, SPECIMEN), LABEL, layout)
    assert np.array_equal(record.hammer.acceleration, 2 * HAMMER)
    assert np.allclose(record.specimen.acceleration, -9.80665 * SPECIMEN, rtol=1e-15)
    assert (record.hammer.full_scale, record.specimen.full_scale) == (30.0, 0.0)
    assert find_scale("m/s^2") == 1.0


def test_times_rounded_on_printing_are_even_enough(save):
    printed = np.round(np.arange(COUNT) / 25_600, 6)
    assert read_trace(save(printed, HAMMER), LABEL).sampling_rate == pytest.approx(
        25_600, rel=1e-2
    )


def test_hits_of_one_series_share_their_rate():
    rates = {
        read_trace(path, LABEL).sampling_rate for path in (DATA / "pyfrf_hammer").glob("*.npy")
    }
    assert rates == {25_600.0}


def test_a_force_hammer_of_another_laboratory_is_read():
    record = read_trace(DATA / "pyfrf_hammer" / "measurements_1_start.npy", LABEL)
    assert record.hammer.acceleration.max() == pytest.approx(68.6, abs=0.05)
    assert record.hammer.acceleration.argmax() == 22
    assert record.specimen.acceleration.size == 600


def test_a_shock_table_of_another_laboratory_is_read():
    layout = TraceFormat(hammer_scale=find_scale("g"))
    record = read_trace(DATA / "repeat_shock" / "acc_base_a0_start.txt", LABEL, layout)
    assert record.sampling_rate == pytest.approx(1 / 2.000278e-5, rel=1e-6)
    assert record.hammer.acceleration.max() == pytest.approx(486 * 9.80665, rel=1e-3)
    assert record.specimen is None


def replaced(values, index, value):
    """Return a copy with one point changed."""
    copy = np.array(values)
    copy[index] = value
    return copy


@pytest.mark.parametrize(
    ("columns", "layout", "told"),
    [
        ((TIME[:5], HAMMER[:5]), None, "5 points: a trace needs at least 16"),
        ((HAMMER,), None, "one column and no time: give its sampling rate"),
        ((TIME, HAMMER, SPECIMEN, SPECIMEN), None, "4 columns: give the role of each"),
        (
            (TIME, HAMMER),
            TraceFormat(columns=("time", "hammer", "specimen")),
            "2 columns, but 3 roles are given",
        ),
        ((TIME, replaced(HAMMER, 7, np.nan)), None, r"hammer is nan at point 7 \(1 such"),
        ((TIME, HAMMER, replaced(SPECIMEN, 3, -np.inf)), None, "specimen is -inf at point 3"),
        ((replaced(TIME, 9, np.nan), HAMMER), None, "time is nan at point 9"),
        ((np.delete(np.append(TIME, TIME[-1] + 4e-7), 20), HAMMER), None, "8e-07 s at point 19"),
        ((HAMMER, TIME), None, "does not grow.*is this the time column"),
        ((TIME[::-1], HAMMER), None, "does not grow from point 0 to 1"),
        ((TIME * 0, HAMMER), None, "does not grow"),
    ],
)
def test_what_is_no_trace_is_named(save, columns, layout, told):
    with pytest.raises(SignalError, match=rf"hit\.npy.*{told}"):
        read_trace(save(*columns), LABEL, layout)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"columns": ("time", "force")}, "'force' is unknown"),
        ({"columns": ("time", "hammer", "hammer")}, "'hammer' is given twice"),
        ({"columns": ("time", "specimen")}, "no column has the role 'hammer'"),
        ({"columns": ("hammer",)}, "one of the two"),
        ({"columns": ("time", "hammer"), "sampling_rate": 1e6}, "one of the two"),
        ({"sampling_rate": 0.0}, "sampling rate is 0.0 Hz"),
        ({"hammer_scale": 0.0}, "hammer scale is 0.0"),
        ({"specimen_scale": np.nan}, "specimen scale is nan"),
        ({"specimen_full_scale": -1.0}, "specimen full scale is -1.0"),
    ],
)
def test_impossible_formats_are_refused(options, told):
    with pytest.raises(ParameterError, match=told):
        TraceFormat(**options)


@pytest.mark.parametrize(
    ("unit", "mass", "told"),
    [("N", None, "needs the hammer's mass"), ("N", 0.0, "0.0 kg"), ("V", None, "'V' is unknown")],
)
def test_units_that_give_no_acceleration_are_refused(unit, mass, told):
    with pytest.raises(ParameterError, match=told):
        find_scale(unit, mass)
