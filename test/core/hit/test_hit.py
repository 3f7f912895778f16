"""From raw record to verdict: the low-pass, what is measured of a hit, and a person's word."""

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import butter, sosfiltfilt

from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.filtering import check_cutoff, low_pass
from impact_rig.core.given.findings import Finding, Reason
from impact_rig.core.given.records import Block, ChannelBlock, HitLabel
from impact_rig.core.given.setup import AnalysisSettings
from impact_rig.core.hit.detection import find_pulse_start
from impact_rig.core.hit.judging import FilteredHit, JudgedHit, judge_hit
from impact_rig.core.hit.overrules import Overrules, describe_overruled, find_label, overrule_hit

from ..blocks import make_record

SETTINGS = AnalysisSettings()
RATE = 2.5e6
COUNT = 5000


def make_traces(
    start: float = 500.0, tau: float = 200e-6, *, noise: float = 0.0, offset: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return a versed-sine of 900 m/s^2 and one of -400 m/s^2 that begin at point `start`."""
    phase = (np.arange(COUNT) - start) / (tau * RATE)
    shape = np.where((phase > 0) & (phase < 1), np.sin(np.pi * phase) ** 2, 0.0)
    random = np.random.default_rng(1).standard_normal((2, COUNT))
    return 900 * shape + offset + noise * random[0], -400 * shape - offset + noise * random[1]


def find_reasons(hit: Any) -> set[Reason]:
    return {item.reason for item in hit.rejections}


@given(tau=st.floats(120e-6, 300e-6), start=st.floats(400, 700), offset=st.floats(-50, 50))
def test_contact_time_is_read_within_a_part_of_a_thousand(tau, start, offset):
    # 50 kHz rounds a versed-sine of 120 us visibly, yet hardly at half amplitude.
    record = make_record(*make_traces(start, tau, offset=offset), rate=RATE, pulse_index=500)
    hit = judge_hit(record, SETTINGS)
    assert hit.accepted
    assert hit.contact_time == pytest.approx(tau, rel=2e-3)
    assert hit.contact_time == 2.0 * hit.half_amplitude_width
    assert hit.impact_time == pytest.approx(start / RATE + tau / 2, abs=0.1 / RATE)
    assert hit.width_ratio == pytest.approx(1.590, abs=0.02)


def make_jagged(dip: float) -> Any:
    """Return the record of two tops, 23 µs apart, that meet at a part `dip` of the first."""
    time = (np.arange(COUNT) - 500) / RATE
    tops = sum(
        height * np.exp(-(((time - middle) / 5e-6) ** 2))
        for height, middle in ((900.0, 20e-6), (765.0, 43e-6))
    )
    bridge = 900.0 * dip * np.exp(-(((time - 31.5e-6) / 5e-6) ** 2))
    noise = 0.5 * np.random.default_rng(1).standard_normal(COUNT)
    return make_record(tops + bridge + noise, rate=RATE, pulse_index=500)


def test_a_pulse_that_the_low_pass_changes_is_a_finding_with_both_figures():
    hit = judge_hit(make_jagged(dip=0.5), SETTINGS)
    (found,) = hit.findings
    assert found.reason is Reason.SMOOTHED
    plain = judge_hit(make_jagged(dip=0.5), AnalysisSettings(cutoff_frequency=0.0))
    assert f"{hit.half_amplitude_width * 1e6:.4g} µs with the 50 kHz" in found.explanation
    assert f"{plain.half_amplitude_width * 1e6:.4g} µs without" in found.explanation
    assert f"peak {100 * hit.hammer_peak / plain.hammer_peak:.1f} %" in found.explanation
    assert not plain.findings


def test_a_second_contact_that_the_low_pass_hides_is_a_double_hit():
    hit = judge_hit(make_jagged(dip=0.0), SETTINGS)
    assert find_reasons(hit) == {Reason.DOUBLE_HIT}
    assert "85 % of the largest follows after 23 µs" in str(hit.rejections[0])


def test_the_crest_of_a_vibration_that_goes_on_is_no_impact():
    dice = np.random.default_rng(2)
    hammer = np.convolve(dice.standard_normal(2000), np.hanning(12), "same")
    hammer[1000:1020] += 6.0 * hammer.std() * np.hanning(20)
    settings = AnalysisSettings(cutoff_frequency=0.0)
    hit = judge_hit(make_record(hammer, rate=20e3, pulse_index=990), settings)
    assert Reason.NO_PULSE in find_reasons(hit)
    strong = np.where(np.arange(2000) // 20 == 50, 10.0, 1.0) * hammer
    accepted = judge_hit(make_record(strong, rate=20e3, pulse_index=990), settings)
    assert Reason.NO_PULSE not in find_reasons(accepted)


def test_a_sample_that_moves_only_after_the_impact_has_no_zero_shift():
    hammer, _ = make_traces()
    specimen = np.where(np.arange(COUNT) > 1100, 50.0, 0.0)
    settings = AnalysisSettings(cutoff_frequency=0.0)
    hit = judge_hit(make_record(hammer, specimen, rate=RATE, pulse_index=500), settings)
    assert (hit.accepted, hit.findings) == (True, ())


@pytest.mark.parametrize(
    ("start", "stop", "told"),
    [(2.0, COUNT, "too late for a baseline"), (500.0, 740, "half its peak on both sides")],
)
def test_a_pulse_without_a_baseline_or_without_its_end_is_truncated(start, stop, told):
    traces = (trace[:stop] for trace in make_traces(start))
    hit = judge_hit(make_record(*traces, rate=RATE, pulse_index=int(start) + 1), SETTINGS)
    assert find_reasons(hit) == {Reason.TRUNCATED}
    assert told in hit.rejections[0].explanation


def test_a_gap_does_not_hide_the_other_reasons():
    traces = (0.2 * trace for trace in make_traces(noise=0.1))
    record = make_record(*traces, rate=RATE, pulse_index=520, flaws=("7 points missing",))
    settings = AnalysisSettings(minimum_peak=0.15)
    assert find_reasons(judge_hit(record, settings)) == {Reason.GAP, Reason.WEAK}


class TestRealHits:
    """Hits on a free structure that another laboratory measured; see test/data."""

    # Widths at half amplitude of the whole recordings, read off between the two points on
    # either side by hand [s].
    WIDTHS: ClassVar = {"measurements_1": 184.5e-6, "measurements_2": 169.4e-6}

    @pytest.mark.parametrize("name", WIDTHS)
    def test_are_accepted_with_the_width_that_is_known(self, name):
        path = Path(__file__).parents[2] / "data" / "pyfrf_hammer" / f"{name}_start.npy"
        _, force, acceleration = np.load(path)
        settings = AnalysisSettings(cutoff_frequency=0.0)
        hammer, nothing = (ChannelBlock(item, 1.0, 0.0, 0.0) for item in (force, np.empty(0)))
        start = find_pulse_start(Block(0, 25.6e3, hammer, nothing), settings)
        record = make_record(force, acceleration, pulse_index=start, full_scale=0.0, rate=25.6e3)
        hit = judge_hit(record, settings)
        assert hit.accepted
        assert hit.half_amplitude_width == pytest.approx(self.WIDTHS[name], abs=0.5e-6)
        assert 68 < hit.hammer_peak < 89

    def test_a_record_that_begins_in_the_foot_of_its_pulse_has_the_zero_of_its_end(self):
        # 2 % of the peak above the zero from the first point on, and rising; see test/data.
        path = Path(__file__).parents[2] / "data" / "repeat_shock" / "acc_base_a0_start.txt"
        _, table = np.loadtxt(path).T
        settings = AnalysisSettings(cutoff_frequency=0.0)
        hit = judge_hit(
            make_record(table, pulse_index=29, full_scale=0.0, rate=49_993.0), settings
        )
        assert hit.accepted
        # The table that it was measured on rings.
        assert [item.reason for item in hit.findings] == [Reason.TRUNCATED, Reason.RINGING]
        assert hit.hammer_peak == pytest.approx(table.max() - table[-20:].mean(), rel=1e-9)
        # The zero before the impact lies between that and the foot, 2.3 % of the peak above it.
        assert hit.filtered.zero_uncertainty[0] > 0.006 * hit.hammer_peak


CUTOFF = 50e3


def find_response(frequency: float) -> complex:
    """Return the gain at a frequency, from the answer to an impulse amid a long record."""
    impulse = np.zeros(20001)
    impulse[10000] = 1.0
    answer = low_pass(impulse, CUTOFF, RATE)
    time = (np.arange(20001) - 10000) / RATE
    return complex(np.sum(answer * np.exp(-2j * np.pi * frequency * time)))


def test_gain_at_the_cutoff_is_minus_3_db():
    # Both passes together; the bilinear transform bends 50 kHz of 2.5 MHz by less than 0.5 %.
    assert abs(find_response(CUTOFF)) == pytest.approx(np.sqrt(0.5), rel=5e-3)


@given(count=st.integers(400, 1200), channels=st.integers(1, 3), seed=st.integers(0, 100))
def test_is_what_scipy_makes_of_the_same_filter_but_for_the_ends(count, channels, seed):
    traces = np.random.default_rng(seed).standard_normal((channels, count))
    one_pass = CUTOFF / (np.sqrt(2) - 1) ** 0.25
    sections = butter(2, one_pass, fs=RATE, output="sos")
    expected = sosfiltfilt(sections, traces, padtype="even", padlen=150)
    # Which are mirrored between two points here, and at the last one there.
    inside = slice(150, -150)
    found = low_pass(traces, CUTOFF, RATE)[..., inside]
    np.testing.assert_allclose(found, expected[..., inside], rtol=0, atol=1e-6)


def test_a_sampling_rate_that_is_too_low_is_named_with_what_would_do():
    with pytest.raises(ParameterError) as error:
        check_cutoff(50e3, 51.2e3)
    message = str(error.value)
    assert "sampling rate of 51.2 kHz is too low for the 50 kHz low-pass" in message
    assert "sample at 125 kHz or more" in message
    assert "cutoff of 20.48 kHz or less" in message
    check_cutoff(50e3, 125e3)


FIRST = HitLabel("steel small", 17, 3, 1)
SECOND = HitLabel("steel small", 18, 3, 2)
OTHER = HitLabel("brass", 3, 1, 1)
LABELS = (FIRST, SECOND, OTHER)
WEAK = Finding(Reason.WEAK, "too weak")


def make_hit(label: HitLabel, *rejections: Finding, pulse: bool = True) -> JudgedHit:
    filtered: Any = object.__new__(FilteredHit) if pulse else None
    return JudgedHit(label, rejections, filtered=filtered)


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("17", FIRST),
        ("3", OTHER),
        ("steel small/3.1", FIRST),
        ("brass/1", OTHER),
    ],
)
def test_a_hit_is_called_by_record_or_by_place(name, label):
    assert find_label(name, LABELS) == label


@pytest.mark.parametrize("name", ["19", "steel", "brass/2", "brass/1.2", "", "17.1"])
def test_an_unknown_hit_is_named(name):
    with pytest.raises(ParameterError, match=f"there is no hit '{name}'") as error:
        find_label(name, LABELS)
    assert "records 3 to 18" in str(error.value)


def test_a_place_with_several_attempts_is_not_guessed():
    with pytest.raises(ParameterError, match=r"17 \(steel small/3.1\), 18 \(steel small/3.2"):
        find_label("steel small/3", LABELS)


def test_a_hit_named_in_both_is_refused():
    with pytest.raises(ParameterError, match=r"hit 17 \(steel small/3\.1\) is both"):
        Overrules(frozenset({FIRST}), frozenset({FIRST}))


def test_a_hit_rejected_by_hand_keeps_its_other_reasons():
    hit = overrule_hit(make_hit(FIRST, WEAK), Overrules(rejected=frozenset({FIRST})))
    assert [str(item) for item in hit.rejections] == [
        "weak: too weak",
        "operator: left out by hand",
    ]


def test_a_hit_accepted_by_hand_remembers_what_was_against_it():
    hit = overrule_hit(make_hit(FIRST, WEAK), Overrules(accepted=frozenset({FIRST})))
    assert hit.accepted
    assert describe_overruled(hit, "hit 17") == (
        "hit 17 accepted by hand, although weak: too weak"
    )


@pytest.mark.parametrize(
    ("hit", "told"),
    [
        (make_hit(FIRST, WEAK, pulse=False), r"no pulse that could be measured \(weak: too weak"),
        (make_hit(FIRST, Finding(Reason.POLARITY, "")), "it shares no mean with the others"),
        (make_hit(FIRST, Finding(Reason.OTHER_KIND, "")), "it shares no mean with the others"),
    ],
)
def test_what_no_mean_can_hold_cannot_be_accepted_by_hand(hit, told):
    with pytest.raises(ParameterError, match=rf"hit 17 .* cannot be accepted by hand: .*{told}"):
        overrule_hit(hit, Overrules(accepted=frozenset({FIRST})))
