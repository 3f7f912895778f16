"""Every reason against a hit, each provoked alone.

A second contact is found, whatever its height and place; ringing of one contact is none.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.given.filtering import low_pass
from impact_rig.core.given.findings import Finding, Reason
from impact_rig.core.given.records import ChannelBlock, Record
from impact_rig.core.given.setup import AnalysisSettings
from impact_rig.core.hit.judging import judge_hit
from impact_rig.core.hit.pulse_width import measure_pulse
from impact_rig.core.hit.pulses import PULSE_SHAPES, VERSED_SINE, PulseShape, compute_pulse
from impact_rig.core.hit.verdict import (
    SecondPulse,
    check_channels,
    check_pulse,
    check_stream,
    check_strength,
    check_tops,
    find_longest_rail_run,
    find_second_pulse,
)

from ..blocks import make_record
from ..struck import Impact

SETTINGS = AnalysisSettings()


def make_trace(
    height: float, start: int = 200, width: int = 200, count: int = 2000, noise: float = 1.0
) -> np.ndarray:
    trace = noise * np.random.default_rng(1).standard_normal(count)
    shape = height * np.sin(np.pi * np.arange(width) / width) ** 2
    stop = min(start + width, count)
    trace[start:stop] += shape[: stop - start]
    return trace


def find_reasons(rejections: list[Finding]) -> list[Reason]:
    return [item.reason for item in rejections]


def judge_pulse(record: Record) -> list[Finding]:
    trace = record.hammer.acceleration
    return check_pulse(trace, measure_pulse(trace), 0.0, record.sampling_rate, SETTINGS)


def judge_strength(
    record: Record, noise: float = 0.0, settings: AnalysisSettings = SETTINGS
) -> list[Finding]:
    return check_strength(
        record,
        [float(np.abs(channel.acceleration).max()) for channel in record.channels],
        noise,
        settings,
        overloaded=Reason.OVERLOAD in find_reasons(check_channels(record)),
    )


class TestStream:
    """What is wrong before anyone looks for a pulse."""

    def test_a_missed_trigger(self):
        (found,) = check_stream(make_record(np.empty(0), triggered=False))
        assert str(found) == "no_trigger: the arming ended without a trigger"

    def test_a_hammer_that_was_disarmed_on_its_way(self):
        (found,) = check_stream(
            replace(make_record(np.empty(0), triggered=False), disarmed="a stop")
        )
        assert str(found) == "disarmed: a stop"

    @pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
    def test_a_value_that_is_no_number(self, value):
        hammer, specimen = make_trace(900.0), make_trace(400.0)
        specimen[[3, 900]] = value
        (found,) = check_stream(make_record(hammer, specimen))
        assert str(found) == "non_finite: 2 points of the sample trace are no numbers"

    def test_an_empty_record(self):
        assert find_reasons(check_stream(make_record(np.empty(0)))) == [Reason.NO_PULSE]


class TestChannels:
    """Dead and overloaded channels."""

    @pytest.mark.parametrize("noise", [0.0, 1.0, 20.0])
    @pytest.mark.parametrize("dead", ["sample", "hammer"])
    def test_a_dead_channel_is_named(self, dead, noise):
        quiet, struck = make_trace(0.0, noise=noise), make_trace(900.0)
        traces, index = ((struck, quiet), 200) if dead == "sample" else ((quiet, struck), None)
        (found,) = check_channels(make_record(*traces, pulse_index=index))
        assert str(found) == f"dead_channel: the {dead} channel shows no signal"

    def test_an_overload_says_how_long_and_where_and_how_high(self):
        specimen = np.clip(make_trace(5000.0, noise=0.0), -2000, 2000)
        (found,) = check_channels(make_record(make_trace(900.0), specimen))
        run = np.count_nonzero(specimen >= 1996)
        # 2000 m/s^2 over the standard acceleration of 9.80665 m/s^2.
        assert str(found) == (
            f"overload: {run} points in a row of the sample at the rail of 2000 m/s^2 (203.9 g)"
        )

    def test_one_point_at_the_rail_may_be_chance_and_two_are_not(self):
        hammer = make_trace(1960.0, noise=0.0)
        hammer[300] = 2000.0
        assert check_channels(make_record(hammer)) == []
        hammer[301] = 2000.0
        assert find_reasons(check_channels(make_record(hammer))) == [Reason.OVERLOAD]

    @pytest.mark.parametrize("bits", [12, 16])
    @pytest.mark.parametrize("rail", [0.985, 1.015])
    def test_the_last_code_may_lie_on_either_side_of_the_nominal_rail(self, rail, bits):
        step = 2000.0 / 2 ** (bits - 1)
        clipped = np.minimum(make_trace(1.03 * rail * 2000.0), rail * 2000.0)
        record = make_record(np.rint(clipped / step) * step, resolution=step)
        assert find_reasons(check_channels(record)) == [Reason.OVERLOAD]

    @pytest.mark.parametrize(
        ("tops", "ranges", "is_overload"),
        [
            # A body that yields: 60 % of the force, on both bodies.
            ((0.6, 0.6), (1000.0, 2000.0), False),
            # An amplifier clips one channel, or both at the same part of their ranges.
            ((0.6, 1.0), (1000.0, 2000.0), True),
            ((0.6, 0.6), (1000.0, 500.0), True),
            # A converter's rail.
            ((0.6, 0.6), (550.0, 2000.0), True),
            # Unknown ranges give no finding.
            ((0.6, 0.6), (0.0, 0.0), True),
        ],
    )
    def test_a_plateau_of_both_bodies_apart_in_their_ranges_is_none(
        self, tops, ranges, is_overload
    ):
        channels = [
            ChannelBlock(
                np.rint(np.minimum(make_trace(height, noise=0.0), top * height)).astype(np.int32),
                1.0,
                0.0,
                full_scale,
            )
            for height, top, full_scale in zip((900.0, 450.0), tops, ranges, strict=True)
        ]
        record = replace(make_record(np.zeros(1)), hammer=channels[0], specimen=channels[1])
        hit = judge_hit(record, replace(SETTINGS, cutoff_frequency=0.0))
        assert (Reason.OVERLOAD in find_reasons(hit.rejections)) is is_overload

    @pytest.mark.parametrize("missing", [15, 40])
    @pytest.mark.parametrize("place", [0.3, 0.7])
    def test_missing_points_are_a_gap_also_where_the_stream_says_nothing(self, place, missing):
        hammer = Impact(noise=5e-4).measure()[0]
        first = 500 + int(place * 212e-6 * 2.5e6)
        record = make_record(np.delete(hammer, slice(first, first + missing)), pulse_index=500)
        (found,) = check_channels(record)
        assert found.reason is Reason.GAP
        assert "the hammer jumps by" in found.explanation

    @pytest.mark.parametrize("part", [0.9, 0.6])
    def test_counts_that_wrap_around_are_an_overload(self, part):
        hammer = Impact().measure()[0]
        limit = part * hammer.max()
        wrapped = (hammer + limit) % (2.0 * limit) - limit
        (found,) = check_channels(make_record(wrapped, pulse_index=500))
        assert found.reason is Reason.OVERLOAD
        assert "its counts wrap around" in found.explanation

    @given(width=st.integers(5, 60), phase=st.floats(0, 1), noise=st.floats(0, 10))
    def test_a_pulse_of_few_points_has_no_dropout(self, width, phase, noise):
        points = np.clip((np.arange(400) - 200 - phase) / width, 0, 1)
        hammer = 900.0 * np.sin(np.pi * points) ** 2
        hammer += noise * np.random.default_rng(1).standard_normal(400)
        assert check_channels(make_record(hammer)) == []


def make_channel(values: np.ndarray) -> ChannelBlock:
    return ChannelBlock(values, 1.0, 0.0, 0.0)


class TestRail:
    """How many points in a row stand at the rail."""

    @given(peak=st.floats(100, 1950))
    def test_is_not_seen_in_a_rounded_top(self, peak):
        step = 2000.0 / 2048
        counts = np.rint(make_trace(peak) / step)
        counted = ChannelBlock(counts.astype(np.int32), step, 0.0, 2000.0)
        assert find_longest_rail_run(counted, 200) == 0
        assert find_longest_rail_run(make_channel(counts * step), 200) == 0

    @pytest.mark.parametrize("volts", [0.2, 1.05])
    @pytest.mark.parametrize("noise", [0.0, 1e-3])
    @pytest.mark.parametrize("levels", [0, 200])
    def test_is_told_from_the_coarse_steps_of_an_oscilloscope(self, volts, noise, levels):
        # Three digits are written: 0.999, 1.00, 1.01; of 8 bits, or of more.
        random = np.random.default_rng(1)
        for exponent, loss in ((1.0, 0.0), (1.5, 0.1), (1.5, 0.5)):
            force = Impact(exponent=exponent, restitution=1.0 - loss).find_force(
                np.arange(COUNT) / 1e6 - 300e-6
            )
            force *= volts / force.max()
            for part in (np.inf, 0.9, 0.7):
                trace = np.minimum(
                    force + noise * volts * random.standard_normal(COUNT), part * volts
                )
                if levels:
                    trace = np.rint(trace / volts * levels) * volts / levels
                written = np.array([float(f"{value:.2e}") for value in trace])
                run = find_longest_rail_run(make_channel(written), 200)
                assert (run >= 2) is (part < 1.0)


class TestTop:
    """An amplifier that clips, whatever adds noise behind it."""

    LAWS = tuple(
        Impact(exponent=exponent, restitution=restitution, resonance=300e3)
        for exponent in (1.0, 1.5, 2.0)
        for restitution in (1.0, 0.9, 0.7, 0.5)
    )

    @pytest.mark.parametrize("impact", LAWS, ids=str)
    def test_of_every_law_is_round(self, impact):
        assert check_tops(impact.measure()) == []

    @pytest.mark.parametrize("resonance", [40e3, 55e3, 70e3, 100e3])
    def test_of_a_sensor_that_rings_is_none(self, resonance):
        for seed in range(20):
            impact = Impact(duration=(100 + 10 * seed) * 1e-6, resonance=resonance, seed=seed)
            filtered = [low_pass(trace, 50e3, 2.5e6) for trace in impact.measure()]
            assert check_tops(np.stack(filtered)) == []

    @pytest.mark.parametrize("impact", LAWS, ids=str)
    @pytest.mark.parametrize("part", [0.85, 0.8])
    def test_is_flat_where_it_is_clipped(self, impact, part):
        force = impact.find_force(np.arange(5000) / 2.5e6 - 200e-6)
        clipped = np.minimum(force, part * force.max())
        clipped += 1e-3 * force.max() * np.random.default_rng(2).standard_normal(5000)
        (found,) = check_tops(np.stack((low_pass(clipped, 50e3, 2.5e6), force)))
        assert found.reason is Reason.OVERLOAD
        assert "the hammer's pulse is flat" in found.explanation


class TestStrength:
    """Too weak, or too strong, for the range."""

    @given(peak=st.floats(100, 1990), sign=st.sampled_from([1, -1]))
    def test_weak_and_strong_are_parts_of_full_scale(self, peak, sign):
        reason = Reason.WEAK if peak < 0.15 * 2000.0 else Reason.STRONG
        is_good = 0.15 * 2000.0 <= peak <= 0.95 * 2000.0
        record = make_record(sign * make_trace(peak, noise=0.0))
        found = judge_strength(record, settings=replace(SETTINGS, minimum_peak=0.15))
        assert find_reasons(found) == ([] if is_good else [reason])

    @pytest.mark.parametrize(
        ("bits", "part", "noise", "is_weak"),
        [(14, 0.1, 1e-4, 0), (8, 0.2, 1e-4, 1), (24, 0.1, 0.99e-3, 0), (24, 0.1, 1.01e-3, 1)],
    )
    def test_weak_goes_by_noise_and_step_where_no_part_is_wanted(self, bits, part, noise, is_weak):
        step = 2000.0 / 2 ** (bits - 1)
        counts = np.rint(make_trace(part * 2000.0, noise=0.0) / step).astype(np.int32)
        record = replace(make_record(np.zeros(1)), hammer=ChannelBlock(counts, step, 0.0, 2000.0))
        assert find_reasons(judge_strength(record, noise * 2000.0)) == [Reason.WEAK] * is_weak

    def test_a_small_answer_of_the_sample_is_not_weak_but_a_large_one_is_strong(self):
        assert judge_strength(make_record(make_trace(900.0), make_trace(100.0))) == []
        (found,) = judge_strength(make_record(make_trace(900.0), make_trace(-1950.0, noise=0.0)))
        told = "strong: sample peak 1950 m/s^2 is above 1900 m/s^2: swing lower, or use a less"
        assert str(found) == f"{told} sensitive range"


class TestPulse:
    """What is wrong with the course of a pulse that could be measured."""

    def test_a_second_pulse_is_described_in_figures(self):
        late = make_trace(180.0, start=500, noise=0.0)
        (found,) = judge_pulse(make_record(make_trace(900.0, noise=0.0) + late))
        assert str(found) == (
            "double_hit: a second pulse of 20 % of the largest follows after 300 µs; from 2 % on"
            " one counts"
        )


LEVEL = 0.05
COUNT = 2000
DURATION = 200.0
"""Of the first pulse, in points."""
REAL_DATA = Path(__file__).parents[2] / "data" / "repeat_shock"


def make_pulse(
    start: float = 300.0, duration: float = DURATION, shape: PulseShape = VERSED_SINE
) -> np.ndarray:
    return compute_pulse(np.arange(COUNT) - start, duration, shape)


def find(trace: np.ndarray) -> SecondPulse | None:
    return find_second_pulse(trace, measure_pulse(trace), LEVEL)


@given(
    shape=st.sampled_from(PULSE_SHAPES),
    sign=st.sampled_from([1, -1]),
    height=st.floats(LEVEL, 0.99),
    delay=st.floats(1.2, 6.0),
    turned=st.booleans(),
    stretch=st.floats(0.7, 1.6),
    seed=st.integers(0, 1000),
)
def test_every_second_contact_is_found(shape, sign, height, delay, turned, stretch, seed):
    first = make_pulse(shape=shape)
    # The delay runs from middle to middle; a longer second contact must not reach into the first.
    delay = max(delay, (1.0 + stretch) / 2.0 + 0.1)
    start = 300.0 + DURATION * (0.5 + delay - stretch / 2.0)
    second = height * make_pulse(start, stretch * DURATION, shape)
    # White noise of 1 in 1000 of the peak after a low-pass that leaves every tenth point new.
    noise = np.repeat(np.random.default_rng(seed).standard_normal(COUNT // 10), 10)
    trace = sign * (first + second + 1e-3 * noise)
    found = find(trace[::-1] if turned else trace)
    assert found.height == pytest.approx(height, abs=0.005)
    delay = -delay if turned else delay
    assert found.delay == pytest.approx(delay * DURATION, abs=0.05 * DURATION)


@given(
    height=st.floats(0.05, 0.5),
    period=st.floats(0.2, 2.5),
    decrement=st.floats(0.0, 0.3),
    phase=st.floats(0.0, 2.0 * np.pi),
)
def test_a_ringing_tail_is_none(height, period, decrement, phase):
    late = (np.arange(COUNT) - 500.0) / (period * DURATION)
    decay = np.exp(-decrement * np.maximum(late, 0.0))
    wave = height * decay * np.sin(2.0 * np.pi * late + phase)
    # It builds up over half a contact time, as the response of a structure does.
    build = np.clip((np.arange(COUNT) - 450.0) / (0.5 * DURATION), 0.0, 1.0)
    found = find(make_pulse() + build * wave)
    assert found is None or found.reason is not Reason.DOUBLE_HIT


def test_the_ringing_of_a_real_shock_is_none():
    # Bumps of 4 to 15 % within a ringing of the table that another laboratory measured.
    _, acceleration = np.loadtxt(REAL_DATA / "acc_base_a0_start.txt").T
    trace = acceleration - acceleration[:20].mean()
    pulse = measure_pulse(trace)
    tail = trace[pulse.peak_index + 24 :]
    assert tail.max() > LEVEL * pulse.peak
    assert find_second_pulse(trace, pulse, LEVEL).reason is Reason.RINGING


@pytest.mark.parametrize(("delay", "height"), [(0.9, 0.1), (0.95, 1.0)])
def test_a_second_contact_that_begins_within_the_first_is_found(delay, height):
    law = Impact(exponent=1.5)
    time = np.arange(COUNT) * law.duration / DURATION - law.duration
    first, second = (law.find_force(time - late * law.duration) for late in (0.0, delay))
    found = find((first + height * second) / first.max())
    assert found.reason is Reason.DOUBLE_HIT
    assert found.height == pytest.approx(height, rel=0.05)
