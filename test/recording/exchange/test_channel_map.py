"""Channels measured elsewhere become hammer and sample; what does not fit is named."""

import math
from pathlib import Path

import numpy as np
import pytest

from impact_rig.core.errors import ParameterError, SignalError
from impact_rig.core.setup.calibration import Sensitivity
from impact_rig.core.setup.channel_plan import ChannelPlan, ChannelUse
from impact_rig.recording.exchange.channel_map import map_channels
from impact_rig.recording.formats.measurement import MeasuredChannel, Measurement
from impact_rig.recording.formats.registry import read_measurement

DATA = Path(__file__).parents[2] / "data"
COUNT = 40
TIME = 0.25 + np.arange(COUNT) * 4e-7
HAMMER = np.sin(np.arange(COUNT))
SPECIMEN = np.cos(np.arange(COUNT))
COUNTS = np.arange(COUNT, dtype=np.int32)


def columns(*values, **fields):
    """Return a measurement whose file states nothing but numbers."""
    return Measurement(
        Path("hit.x"),
        tuple(
            MeasuredChannel(f"column {number}", np.array(column), **fields)
            for number, column in enumerate(values, 1)
        ),
    )


def channel(name, values=HAMMER, rate=25_600.0, unit="m/s^2", start=0.0):
    return MeasuredChannel(name, values, rate, unit, start)


def stated(*channels):
    return Measurement(Path("hit.x"), channels)


def plan(**fields):
    return ChannelPlan(**fields)


def test_three_columns_are_time_hammer_and_sample():
    found = map_channels(columns(TIME, HAMMER, SPECIMEN), plan())
    assert found.sampling_rate == pytest.approx(2.5e6, rel=1e-8)
    assert np.array_equal(found.hammer.output, HAMMER)
    assert np.array_equal(found.specimen.output, SPECIMEN)
    assert (found.hammer.scale, found.hammer.offset, found.hammer.full_scale) == (1.0, 0.0, 0.0)
    assert found.assumed == ("hammer", "sample")


def test_two_columns_are_time_and_hammer():
    found = map_channels(columns(TIME, HAMMER), plan())
    assert found.specimen.output.size == 0
    assert np.array_equal(found.hammer.output, HAMMER)


def test_a_given_rate_stands_in_for_time():
    given = plan(sampling_rate=51_200.0)
    assert map_channels(columns(HAMMER), given).sampling_rate == 51_200.0
    both = map_channels(columns(HAMMER, SPECIMEN), given)
    assert np.array_equal(both.specimen.output, SPECIMEN)


def test_roles_pick_columns_in_any_order():
    roles = plan(columns=("specimen", "skip", "time", "skip", "hammer"))
    found = map_channels(columns(SPECIMEN, HAMMER * np.nan, TIME, TIME, HAMMER), roles)
    assert np.array_equal(found.hammer.output, HAMMER)
    assert np.array_equal(found.specimen.output, SPECIMEN)


def test_where_files_state_rates_the_first_two_channels_are_hammer_and_sample():
    slow = channel("temperature", np.zeros(5), 1.0, "degC")
    file = stated(channel("force", unit="N"), channel("response", SPECIMEN, unit="g"), slow)
    found = map_channels(file, plan(), hammer_mass=0.5)
    assert found.names == ("force", "response")
    assert (found.hammer.scale, found.specimen.scale) == (2.0, 9.80665)
    assert found.assumed == ()


@pytest.mark.parametrize(("hammer", "specimen"), [("b", "a"), ("2", "1")])
def test_channels_are_told_by_name_or_number(hammer, specimen):
    file = stated(channel("a", SPECIMEN), channel("b", HAMMER))
    named = plan(hammer=ChannelUse(hammer), specimen=ChannelUse(specimen))
    found = map_channels(file, named)
    assert found.names == ("b", "a")
    assert np.array_equal(found.hammer.output, HAMMER)


def test_with_the_hammers_channel_alone_the_sample_is_not_measured():
    found = map_channels(stated(channel("a"), channel("b")), plan(hammer=ChannelUse("b")))
    assert found.names == ("b",)
    assert found.specimen.output.size == 0


def test_beside_named_columns_the_first_one_is_time():
    named = plan(hammer=ChannelUse("column 3"), specimen=ChannelUse("2"))
    found = map_channels(columns(TIME, SPECIMEN, HAMMER, HAMMER), named)
    assert found.sampling_rate == pytest.approx(2.5e6, rel=1e-8)
    assert np.array_equal(found.hammer.output, HAMMER)


def test_times_may_be_stated_in_other_units():
    file = stated(MeasuredChannel("time", TIME * 1e3, unit="ms"), MeasuredChannel("a", HAMMER))
    assert map_channels(file, plan()).sampling_rate == pytest.approx(2.5e6, rel=1e-8)
    odd = stated(MeasuredChannel("time", TIME, unit="V"), MeasuredChannel("a", HAMMER))
    with pytest.raises(SignalError, match="times are in 'V'"):
        map_channels(odd, plan())


def test_counts_stay_counts_beside_their_calibration():
    use = ChannelUse(sensitivity=Sensitivity(0.01, "g"), full_scale=5.0, full_scale_unit="V")
    found = map_channels(stated(channel("a", COUNTS, unit="mV")), plan(hammer=use))
    assert found.hammer.output.dtype == np.int32
    # 10 mV/g: one millivolt is 0.1 g; 5 V are 500 g.
    assert found.hammer.scale == pytest.approx(0.980665, rel=1e-12)
    assert found.hammer.full_scale == pytest.approx(500 * 9.80665, rel=1e-12)


def test_a_force_hammers_voltage_becomes_acceleration_by_its_mass():
    use = ChannelUse(sensitivity=Sensitivity(-0.002, "N"))
    found = map_channels(stated(channel("a", unit="V")), plan(hammer=use), hammer_mass=0.5)
    assert found.hammer.scale == pytest.approx(-1000.0, rel=1e-12)


def test_a_force_without_a_mass_is_good_for_contact_times_only():
    file = stated(channel("a", unit="N"))
    found = map_channels(file, plan(), needs_scale=False)
    assert (found.has_scale, found.hammer.scale) == (False, 1.0)
    with pytest.raises(ParameterError, match=r"hit\.x: hammer: .*needs the hammer's mass"):
        map_channels(file, plan())


@pytest.mark.parametrize("spelling", ["m/s²", "m/s2", " m/s^2 ", "m/s**2"])
def test_units_are_known_in_their_spellings(spelling):
    use = ChannelUse(unit="m/s^2")
    assert map_channels(stated(channel("a", unit=spelling)), plan(hammer=use)).hammer.scale == 1.0


def test_hits_of_one_series_share_their_rate():
    rates = {
        map_channels(read_measurement(path), plan()).sampling_rate
        for path in (DATA / "pyfrf_hammer").glob("*.npy")
    }
    assert rates == {25_600.0}


def test_a_shock_table_of_another_laboratory_is_read():
    file = read_measurement(DATA / "repeat_shock" / "acc_base_a0_start.txt")
    found = map_channels(file, plan(hammer=ChannelUse(unit="g")))
    assert found.sampling_rate == pytest.approx(1 / 2.000278e-5, rel=1e-6)
    assert found.hammer.scale * found.hammer.output.max() == pytest.approx(486 * 9.80665, rel=1e-3)


def replaced(values, index, value):
    """Return a copy with one point changed."""
    copy = np.array(values)
    copy[index] = value
    return copy


@pytest.mark.parametrize(
    ("file", "given", "told"),
    [
        (columns(TIME[:5], HAMMER[:5]), {}, "5 points in 'column 1': a trace needs at least 16"),
        (columns(HAMMER), {}, "has no time and states no rate: give its sampling rate"),
        (columns(TIME, HAMMER, SPECIMEN, SPECIMEN), {}, "4 columns: give the role of each"),
        (columns(*[HAMMER] * 3), {"sampling_rate": 1e6}, "3 columns: give the role of each"),
        (
            columns(TIME, HAMMER),
            {"columns": ("time", "hammer", "specimen")},
            "2 columns, but 3 roles are given",
        ),
        (columns(TIME, replaced(HAMMER, 7, np.nan)), {}, r"hammer is nan at point 7 \(1 such"),
        (columns(TIME, HAMMER, replaced(SPECIMEN, 3, -np.inf)), {}, "sample is -inf at point 3"),
        (columns(replaced(TIME, 9, np.nan), HAMMER), {}, "time is nan at point 9"),
        (columns(np.delete([*TIME, TIME[-1] + 4e-7], 20), HAMMER), {}, "8e-07 s at point 19"),
        (columns(HAMMER, TIME), {}, "does not grow.*is this the time column"),
        (columns(TIME[::-1], HAMMER), {}, "does not grow from point 0 to 1"),
        (columns(TIME * 0, HAMMER), {}, "does not grow"),
        (stated(channel("a"), channel("b", HAMMER[:20])), {}, "'a' and 'b' have 40 and 20 points"),
        (stated(channel("a"), channel("b", rate=1e3)), {}, "sampled at 25600 Hz and 1000 Hz"),
        (stated(channel("a"), channel("b", start=0.1)), {}, "start 0.1 s apart"),
        (stated(channel("a")), {"hammer": ChannelUse("c")}, "no channel 'c': it has 1 'a'"),
        (stated(channel("a"), channel("a")), {"hammer": ChannelUse("a")}, "2 channels 'a'"),
    ],
)  # fmt: skip
def test_what_is_no_trace_is_named(file, given, told):
    with pytest.raises(SignalError, match=rf"hit\.x.*{told}"):
        map_channels(file, ChannelPlan(**given))


@pytest.mark.parametrize(
    ("file", "given", "told"),
    [
        (stated(channel("a")), {"hammer": ChannelUse(unit="g")}, "in m/s.2, as the file states"),
        (stated(channel("a", unit="Pa")), {}, "in Pa, which is no unit known here"),
        (stated(channel("a", unit="V")), {}, "channel in V needs a sensitivity"),
        (stated(channel("a")), {"sampling_rate": 1e3}, "sampled at 25600 Hz, as it states"),
        (stated(channel("a"), channel("b", unit="N")), {}, "'b' is a force"),
        (
            stated(channel("a")),
            {"hammer": ChannelUse("a"), "specimen": ChannelUse("1")},
            "are the same channel",
        ),
        (
            stated(channel("a")),
            {"hammer": ChannelUse(sensitivity=Sensitivity(0.1, "g"))},
            "as the file states, not in V",
        ),
    ],
)
def test_what_the_user_contradicts_or_leaves_open_is_named(file, given, told):
    with pytest.raises(ParameterError, match=rf"hit\.x.*{told}"):
        map_channels(file, ChannelPlan(**given), math.nan)
