"""Each threshold of a verdict, tried just below and just above."""

import math
from dataclasses import replace

import numpy as np
import pytest
from core.blocks import make_record

from impact_rig.core.estimates.checks import SLIPS, ask_for_sample, check_chain, check_speed
from impact_rig.core.estimates.uncertainty import Source, make_quantity
from impact_rig.core.given.findings import Finding, Reason
from impact_rig.core.given.quantity import UNKNOWN, Quantity
from impact_rig.core.given.records import ChannelBlock, FloatArray
from impact_rig.core.given.setup import PAPER_SETUP, AnalysisSettings
from impact_rig.core.hit.detection import SPREAD_OF_MEDIAN
from impact_rig.core.hit.pulse_width import measure_pulse, measure_rise
from impact_rig.core.hit.pulses import VERSED_SINE, compute_pulse
from impact_rig.core.hit.verdict import (
    check_channels,
    check_low_pass,
    check_pulse,
    check_tops,
    find_dropout,
    find_jump,
    find_longest_rail_run,
    find_second_pulse,
    find_step,
    shows_plateau,
)

SETTINGS = AnalysisSettings()
RATE = 1e6
JUST = pytest.mark.parametrize("side", [0.98, 1.02], ids=["below", "above"])
"""What is tried is this times the threshold."""


def make_channel(values: FloatArray, resolution: float = 0.0) -> ChannelBlock:
    return make_record(values, full_scale=0.0, resolution=resolution).hammer


def make_bump(middle: float, duration: float, count: int = 2000) -> FloatArray:
    """Return a versed-sine of height 1, half as wide at half amplitude as it lasts."""
    return compute_pulse(np.arange(count) - (middle - duration / 2.0), duration, VERSED_SINE)


def make_quiet(noise: float, count: int = 200) -> FloatArray:
    """Return points whose standard deviation is `noise`, whatever their number."""
    return noise * np.resize([1.0, -1.0], count)


def list_reasons(found: list[Finding]) -> list[Reason]:
    return [item.reason for item in found]


@JUST
def test_values_that_differ_by_a_billionth_are_one_count(side):
    values = np.array([0.99, 1.0 - side * 1e-9, 1.0])
    step = find_step(values, 1.0)
    assert step == pytest.approx(0.01 if side < 1.0 else side * 1e-9, rel=1e-6)


class TestDropout:
    """A single point off a smooth curve that reaches 1000 m/s^2."""

    def find(
        self, height: float, place: int = 800, noise: float = 0.0, resolution: float = 0.0
    ) -> Finding | None:
        values = 1000.0 * make_bump(500.0, 400.0, 1200)
        values[:200] += make_quiet(noise)
        values[place] += height
        return find_dropout("hammer", make_channel(values, resolution), 200, RATE)

    @JUST
    def test_is_ten_standard_deviations_off(self, side):
        assert (self.find(side * 10.0 * 8.0, noise=8.0) is not None) is (side > 1.0)

    @pytest.mark.parametrize("counts", [2, 3])
    def test_is_three_counts_off(self, counts):
        assert (self.find(counts * 25.0, resolution=25.0) is not None) is (counts == 3)

    @pytest.mark.parametrize(("count", "is_seen"), [(1, 0), (8, 0), (9, 1)])
    def test_is_looked_for_among_nine_points_and_more(self, count, is_seen):
        values = np.where(np.arange(count) == 4, 1000.0, 0.0)
        found = find_dropout("hammer", make_channel(values, 1.0), 2, RATE)
        assert (found is not None) is bool(is_seen)

    @JUST
    def test_is_a_twentieth_of_the_range_between_both_extremes_off(self, side):
        values = 1000.0 * (make_bump(500.0, 400.0, 1200) - make_bump(900.0, 400.0, 1200))
        values[100] += side * 0.05 * 2000.0
        assert (find_dropout("hammer", make_channel(values), 90, RATE) is not None) is (side > 1.0)

    @pytest.mark.parametrize(("place", "is_seen"), [(3, 0), (4, 1), (1195, 1), (1196, 0)])
    def test_has_four_neighbours_on_either_side(self, place, is_seen):
        assert (self.find(500.0, place) is not None) is bool(is_seen)

    @pytest.mark.parametrize("place", [420, 560, 800])
    def test_says_where_and_how_far_also_on_a_flank(self, place):
        # A cubic through four neighbours meets a flank within 1e-5 of its height.
        assert self.find(-120.0, place).explanation == (
            f"a single point of the hammer, {place} µs into the record, is 120 m/s^2 off its"
            " neighbours"
        )


class TestJump:
    """A step between two points of a flank that rises by 2.5 m/s^2 a point."""

    def find(
        self,
        off: float,
        *,
        place: int = 400,
        noise: float = 0.0,
        resolution: float = 0.0,
        first: int = 300,
    ) -> Finding | None:
        """Find a step that is `off` [m/s^2] beyond the slope, which begins at `first`."""
        steps = np.zeros(900)
        steps[first:500] = 2.5
        steps[place] += off
        steps[550:750] = -steps.sum() / 200.0  # back to zero
        values = np.concatenate(([0.0], np.cumsum(steps)))
        values[:200] += make_quiet(noise)
        return find_jump("hammer", make_channel(values, resolution), 200, RATE)

    @JUST
    def test_is_eight_standard_deviations_of_a_difference(self, side):
        off = 8.0 * np.sqrt(2.0) * 5.0
        assert (self.find(side * off, noise=5.0) is not None) is (side > 1.0)

    @JUST
    def test_is_a_fiftieth_of_the_range(self, side):
        off = 0.02 * side * 500.0 / (1.0 - 0.02 * side)  # its own height is part of the range
        assert (self.find(off) is not None) is (side > 1.0)

    @pytest.mark.parametrize("counts", [2, 3])
    def test_is_three_counts(self, counts):
        # The range is small enough that a fiftieth of it is less.
        found = self.find(counts * 2.5, resolution=2.5, place=450, first=400)
        assert (found is not None) is (counts == 3)

    @pytest.mark.parametrize("place", [315, 340])
    def test_begins_and_ends_a_tenth_of_the_range_off_the_baseline(self, place):
        assert (self.find(100.0, place=place) is not None) is (place == 340)

    @pytest.mark.parametrize("part", [0.58, 0.62])
    def test_of_six_tenths_of_the_range_is_no_gap(self, part):
        off = part * 497.5 / (1.0 - part)
        assert (self.find(off) is not None) is (part < 0.6)

    def test_goes_on_in_the_direction_of_the_flank(self):
        assert self.find(-100.0) is None

    @pytest.mark.parametrize("beside", [0.4, 0.6])
    def test_stands_beside_no_steps_of_half_its_height(self, beside):
        values = np.concatenate((np.zeros(300), 2.5 * np.arange(200), np.zeros(300)))
        values[300:500] += 100.0 * (np.arange(200) > 100) + beside * 100.0 * (np.arange(200) > 103)
        values[500:] = np.linspace(values[499], 0.0, 300)
        found = find_jump("hammer", make_channel(values), 200, RATE)
        assert (found is not None) is (beside < 0.5)

    def test_says_where_how_far_and_what_it_is(self):
        found = self.find(100.0)
        assert found.reason is Reason.GAP
        assert found.explanation == (
            "the hammer jumps by 100 m/s^2 between two points 400 µs into the record: points are"
            " missing"
        )


class TestChannels:
    """Signal, rail and top of one channel."""

    @JUST
    @pytest.mark.parametrize("noise", [0.0, 5.0])
    def test_a_signal_is_half_a_percent_of_the_range_and_six_standard_deviations(
        self, side, noise
    ):
        sample = np.zeros(2000)
        sample[:100] = make_quiet(noise, 100)
        sample[300:310] = side * max(0.005 * 2000.0, 6.0 * noise)
        found = check_channels(make_record(900.0 * make_bump(500.0, 200.0), sample))
        assert (Reason.DEAD_CHANNEL in list_reasons(found)) is (side < 1.0)

    @pytest.mark.parametrize("off", [-0.1, 0.1])
    def test_the_rail_begins_a_step_and_a_five_hundredth_below_full_scale(self, off):
        values = 1900.0 * make_bump(500.0, 200.0)
        values[500:503] = 2000.0 * (1.0 - 2e-3) - 1.0 + off, 1990.0, 1996.0
        trace = ChannelBlock(np.rint(10.0 * values).astype(np.int32), 0.1, 0.0, 2000.0)
        coarse = ChannelBlock(np.rint(values).astype(np.int32), 1.0, 0.0, 2000.0)
        assert find_longest_rail_run(trace, 200) == 1
        assert find_longest_rail_run(coarse, 200) == 1
        values[501] = 1995.0
        coarse = ChannelBlock(np.rint(values).astype(np.int32), 1.0, 0.0, 2000.0)
        assert find_longest_rail_run(coarse, 200) == 3

    @pytest.mark.parametrize("top", [55, 59])
    def test_a_top_is_flat_by_its_width_over_its_shoulders(self, top):
        # Of a trapezoid with flanks of f points the widths at 0.95 and 0.985 of its height are
        # t + 0.1 f and t + 0.03 f: the second is 4.5 times their difference at t = 0.285 f.
        flank = np.arange(200) / 200.0
        trace = np.concatenate(
            (np.zeros(300), flank, np.ones(top + 1), flank[::-1], np.zeros(300))
        )
        assert bool(check_tops(trace[np.newaxis])) is (top > 0.285 * 200)

    @pytest.mark.parametrize(
        ("ranges", "is_contact"),
        [
            ((1000.0, 1090.0), False),  # parts of 0.9 and 0.826 of their ranges: 0.917 apart
            ((1000.0, 1130.0), True),  # 0.885 apart
            ((900.0 / 0.96, 2000.0), False),  # one stands at its rail
            ((900.0 / 0.94, 2000.0), True),
        ],
    )
    def test_a_plateau_is_the_contacts_where_the_ranges_are_a_tenth_apart(
        self, ranges, is_contact
    ):
        trace = 900.0 * np.minimum(2.0 * make_bump(500.0, 200.0), 1.0)
        record = make_record(trace, trace)
        hammer, sample = (ChannelBlock(trace, 1.0, 0.0, scale) for scale in ranges)
        assert shows_plateau(replace(record, hammer=hammer, specimen=sample)) is is_contact

    @pytest.mark.parametrize("more", [0, 1])
    def test_a_plateau_is_the_contacts_where_both_bodies_have_most_of_it(self, more):
        trace = 900.0 * np.minimum(2.0 * make_bump(500.0, 200.0), 1.0)
        # Tops of w points that are l apart share (w - l) / (w + l): 0.8 at l = w / 9.
        late = np.count_nonzero(trace > 0.97 * 900.0) // 9 + more
        hammer, sample = (
            ChannelBlock(np.roll(trace, shift), 1.0, 0.0, scale)
            for shift, scale in ((0, 1000.0), (late, 2000.0))
        )
        record = replace(make_record(trace), hammer=hammer, specimen=sample)
        assert shows_plateau(record) is (more == 0)


class TestPulse:
    """A pulse of 1000 m/s^2 that is 100 points wide at half amplitude."""

    trace = 1000.0 * make_bump(500.0, 200.0)
    pulse = measure_pulse(trace)

    def judge(self, trace: FloatArray | None = None, noise: float = 0.0, **other) -> list[Reason]:
        pulse = replace(self.pulse, **other)
        found = check_pulse(self.trace if trace is None else trace, pulse, noise, RATE, SETTINGS)
        return list_reasons(found)

    def test_rises_as_a_versed_sine_does(self):
        # sin^2(pi t / 200) is 0.1 and 0.9 at these times.
        rise = 200.0 / np.pi * (np.arcsin(np.sqrt(0.9)) - np.arcsin(np.sqrt(0.1)))
        assert measure_rise(-self.trace) == pytest.approx(rise, abs=0.05)

    @JUST
    def test_is_three_points_wide(self, side):
        found = self.judge(half_amplitude_width=3.0 * side)
        assert (Reason.FEW_POINTS in found) is (side < 1.0)

    @JUST
    def test_stands_out_of_the_noise_by_eight_standard_deviations(self, side):
        assert (Reason.NO_PULSE in self.judge(noise=1000.0 / (8.0 * side))) is (side < 1.0)

    @pytest.mark.parametrize("points", [0, 1])
    def test_is_followed_by_as_much_as_it_is_wide(self, points):
        last = int(np.ceil(self.pulse.fall + self.pulse.half_amplitude_width))
        found = self.judge(self.trace[: last + points])
        assert (Reason.TRUNCATED in found) is (points == 0)

    @pytest.mark.parametrize("sign", [1.0, -1.0])
    @pytest.mark.parametrize("side", [0.9, 1.1])
    @pytest.mark.parametrize("noise", [0.0, 2.0])
    @pytest.mark.parametrize("what", ["width", "peak"])
    def test_is_changed_by_a_hundredth_and_noise_by_the_low_pass(self, side, noise, what, sign):
        part = 1.0 + sign * side * (0.01 + 6.0 * noise / 1000.0)
        changed = {
            "width": {"half_amplitude_width": part * self.pulse.half_amplitude_width},
            "peak": {"peak": part * self.pulse.peak},
        }[what]
        filtered = replace(self.pulse, **changed)
        found = check_low_pass(self.trace, filtered, noise, RATE, SETTINGS)
        assert list_reasons(found) == ([Reason.SMOOTHED] if side > 1.0 else [])

    def test_that_is_changed_by_the_low_pass_says_how(self):
        filtered = replace(self.pulse, peak=800.0, half_amplitude_width=125.0)
        (found,) = check_low_pass(self.trace, filtered, 0.0, RATE, SETTINGS)
        assert found.is_harmless
        assert found.explanation == (
            "width at half amplitude 125 µs with the 50 kHz low-pass, 100 µs without; peak 80.0 %"
            " of that without"
        )


class TestSecondPulse:
    """A bump beside a pulse that is 100 points wide, 159 points at a tenth of its height."""

    trace = make_bump(400.0, 200.0)
    pulse = measure_pulse(trace)

    def find(self, bump: FloatArray, level: float = 0.05, noise: float = 0.0) -> Reason | None:
        found = find_second_pulse(self.trace + bump, self.pulse, level, noise)
        return found.reason if found else None

    @JUST
    @pytest.mark.parametrize(("level", "noise"), [(0.05, 0.0), (0.05, 0.01)])
    def test_is_nine_tenths_of_the_level_and_six_standard_deviations_high(
        self, side, level, noise
    ):
        least = max(0.9 * level, 6.0 * noise)
        found = self.find(side * least * make_bump(1000.0, 200.0), level, noise)
        assert found is (Reason.DOUBLE_HIT if side > 1.0 else None)

    @JUST
    def test_is_half_as_wide(self, side):
        found = self.find(0.5 * make_bump(1000.0, 100.0 * side))
        assert found is (Reason.DOUBLE_HIT if side > 1.0 else None)

    @JUST
    @pytest.mark.parametrize(
        ("height", "apart"), [(0.5, 1.3 * 100.0), (0.04, 1.36 * pulse.tenth_amplitude_width)]
    )
    def test_is_so_far_from_the_first(self, side, height, apart):
        found = self.find(height * make_bump(400.0 + side * apart, 110.0), level=0.02)
        assert found is (Reason.DOUBLE_HIT if side > 1.0 else None)

    @JUST
    @pytest.mark.parametrize("behind", [100.0, 150.0])
    def test_is_ringing_where_the_trace_swings_back_by_half(self, side, behind):
        wave = make_bump(1000.0, 120.0) - 0.5 * side * make_bump(1000.0 + behind, 90.0)
        found = self.find(0.2 * wave)
        assert found is (Reason.RINGING if side > 1.0 else Reason.DOUBLE_HIT)

    @JUST
    def test_that_rings_is_harmless_and_one_of_a_contact_is_none(self, side):
        wave = make_bump(1000.0, 120.0) - 0.5 * side * make_bump(1100.0, 90.0)
        (found,) = check_pulse(self.trace + 0.2 * wave, self.pulse, 0.0, RATE, SETTINGS)
        assert found.is_harmless is (side > 1.0)

    @JUST
    def test_is_the_zeros_where_that_wanders_by_a_tenth_of_it(self, side):
        tail = (np.arange(2000) > 600) * (0.1 / SPREAD_OF_MEDIAN * 0.2 * side)
        bump = np.maximum(0.2 * make_bump(1000.0, 200.0), tail)
        assert self.find(bump) is (Reason.UNSTEADY_ZERO if side > 1.0 else Reason.DOUBLE_HIT)

    @JUST
    def test_counts_where_the_zero_wanders_from_a_twentieth_on(self, side):
        tail = (np.arange(2000) > 600) * 0.01
        bump = np.maximum(0.05 * side * make_bump(1000.0, 200.0), tail)
        (found,) = check_pulse(self.trace + bump, self.pulse, 0.0, RATE, SETTINGS)
        assert found.reason is Reason.UNSTEADY_ZERO
        assert found.is_harmless is (side < 1.0)


class TestSample:
    """Whose mass the traces show, in kg."""

    @pytest.mark.parametrize("sign", [1.0, -1.0])
    @JUST
    @pytest.mark.parametrize(("expanded", "apart"), [(0.0, 0.15), (0.3, 0.3)])
    def test_another_is_asked_for_beyond_a_seventh_and_the_uncertainty(
        self, side, sign, expanded, apart
    ):
        asked = ask_for_sample(1.0 + sign * side * apart, 1.0, expanded)
        assert (asked is not None) is (side > 1.0)

    @JUST
    @pytest.mark.parametrize("sign", [1.0, -1.0])
    @pytest.mark.parametrize("assumed", [0.0, 0.03])
    def test_a_speed_is_another_beyond_a_fiftieth_and_what_is_stated(self, side, sign, assumed):
        # What is assumed widens the interval, and eases nothing.
        lines = {Source("form of the loss"): 0.002**2, Source("gain, assumed"): assumed**2}
        apart = 0.02 + math.hypot(1.96 * 0.002, 2.0 * 0.004)
        speed = make_quantity(1.0 + sign * side * apart, lines)
        setup = replace(PAPER_SETUP, impact_speed=1.0, impact_speed_uncertainty=0.004)
        found = check_speed(speed, UNKNOWN, setup, "stated")
        assert (found is not None) is (side > 1.0)

    @JUST
    @pytest.mark.parametrize(("slip", "sign"), [(2.0, -1.0), (9.81, -1.0), (2.0, 1.0)])
    def test_a_slip_is_named_within_a_twentieth(self, side, slip, sign):
        ratio = slip / (1.0 - sign * 0.05) * side**-sign
        setup = replace(PAPER_SETUP, impact_speed=1.0)
        found = check_speed(Quantity(ratio, 0.0, 0.0), UNKNOWN, setup, "stated")
        assert (SLIPS[slip] in found.explanation) is (side > 1.0)

    @JUST
    @pytest.mark.parametrize("end", [0.0, 1.0])
    def test_without_a_law_e_lies_between_0_and_1_within_its_uncertainty(self, side, end):
        e = Quantity(end + math.copysign(0.1 * side, end - 0.5), 0.05, 0.1)
        found = check_speed(UNKNOWN, e, PAPER_SETUP, "measured")
        assert (found is not None) is (side > 1.0)
        if found:
            shown = f"{(1.0 + e.value) / 2.0:.2g} to {1.0 + e.value:.2g} times"
            assert f"{shown} the 8.19 cm/s that are measured" in found.explanation

    @pytest.mark.parametrize("sign", [1.0, -1.0])
    @JUST
    def test_a_free_mass_moves_as_it_should_within_a_twentieth(self, side, sign):
        found = check_chain(0.1 * (1.0 + sign * 0.05 * side), 0.1)
        assert list_reasons(list(found)) == ([Reason.OPERATIONAL_CHECK] if side > 1.0 else [])
