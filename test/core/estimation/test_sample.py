"""From mean traces to tau_p, k and c: known bodies are found again, gaps in knowledge named."""

import statistics
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import StateSpace, impulse

from impact_rig.core.damping.log_decrement import estimate_damping_coefficient
from impact_rig.core.estimation.paper_method import BodyEstimate, estimate_contact, estimate_hammer
from impact_rig.core.estimation.sample import SampleEstimate, add_checks, estimate_numbers
from impact_rig.core.hits.averaging import MeanHit, shift_hit
from impact_rig.core.hits.hit import FilteredHit
from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.model.impact import ModelVariant
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.setup.samples import RigSetup, Sample, SampleSet
from impact_rig.core.setup.settings import AnalysisSettings

RATE = 2.5e6
ORIGIN = 754
K1 = 22e6
HAMMER = BodyEstimate(K1, 5.0, 0.623, 1848.0)
SETUP = RigSetup(
    SampleSet((Sample("alike", 0.097), Sample("heavy", 0.297)), "alike", 3e-3),
    hammer_mass=0.1,
    impact_speed=0.08,
    analysis=AnalysisSettings(cutoff_frequency=0.0),
)


def make_mean(tau: float, natural: float, ratio: float, *, channels: int = 2) -> MeanHit:
    """Return a versed-sine of `tau`, and a body that swings freely from the pulse's top on."""
    count = 5000
    points = np.arange(count) - ORIGIN
    phase = points / RATE / tau + 0.5
    pulse = np.where((phase > 0) & (phase < 1), np.sin(np.pi * phase) ** 2, 0.0)
    system = StateSpace(
        [[0, 1], [-(natural**2), -2 * ratio * natural]], [[1], [0]], [[1, 0]], [[0]]
    )
    _, decay = impulse(system, T=np.arange(count - ORIGIN) / RATE)
    specimen = pulse.copy()
    specimen[ORIGIN:] = decay
    traces = np.stack([900.0 * pulse, -300.0 * specimen])[:channels]
    nothing = np.zeros(channels)
    hit = FilteredHit(traces, RATE, measure_pulse(traces[0]), nothing, nothing, nothing, 300)
    return MeanHit(traces, RATE, ORIGIN, nothing, nothing, (shift_hit(hit),) * 3)


def estimate_sample(
    name: str,
    mean: MeanHit,
    contact_times: tuple[float, ...],
    rejected: int,
    hammer: BodyEstimate,
    setup: RigSetup,
) -> SampleEstimate:
    """Return the numbers of a sample with what stands beside them."""
    spread = statistics.stdev(contact_times) if len(contact_times) > 1 else np.nan
    numbers = estimate_numbers(name, mean, spread, rejected, hammer, setup)
    return add_checks(numbers, mean, hammer, setup)


@given(stiffness=st.floats(10e6, 60e6), ratio=st.floats(0.15, 0.5), mass=st.floats(0.02, 0.4))
@settings(max_examples=40)
def test_a_known_sample_is_found_again(stiffness: float, ratio: float, mass: float) -> None:
    setup = replace(SETUP, samples=SampleSet((Sample("x", mass),), "", 3e-3))
    moving = mass + 3e-3
    m_eq = 0.1 * moving / (0.1 + moving)
    tau = np.pi * np.sqrt(m_eq * (1 / K1 + 1 / stiffness))
    mean = make_mean(tau, np.sqrt(stiffness / moving), ratio)
    found = estimate_sample("x", mean, (tau, tau, tau), 0, HAMMER, setup)
    assert found.contact is not None
    # Interpolated crossings of some 250 points: 1e-5.
    assert found.contact.contact_time == pytest.approx(tau, rel=1e-4)
    # k2 is a difference: what tau_p lacks counts up to 2 (1 + k2 / k1) = 8 times.
    assert found.body.stiffness == pytest.approx(stiffness, rel=1e-3)
    assert found.body.damping_ratio == pytest.approx(ratio, rel=1e-3)
    expected = estimate_damping_coefficient(ratio, stiffness, moving)
    assert found.body.damping_coefficient == pytest.approx(expected, rel=2e-3)
    assert found.hammer_peak == pytest.approx(900.0, rel=1e-3)
    assert found.specimen_peak == pytest.approx(300.0, rel=1e-3)
    assert found.body.notes == ()


def test_the_pulse_factor_scales_contact_time_and_stiffness() -> None:
    mean = make_mean(200e-6, 1.5e4, 0.3)
    sine = replace(SETUP, analysis=replace(SETUP.analysis, pulse_factor=1.5))
    one, other = (estimate_contact(mean, setup, "heavy") for setup in (SETUP, sine))
    assert other.half_amplitude_width == one.half_amplitude_width
    assert other.contact_time == pytest.approx(0.75 * one.contact_time)
    # k goes with F^-2: a half-sine read with F = 2 gives 0.5625 k.
    assert one.equivalent_stiffness == pytest.approx(0.5625 * other.equivalent_stiffness)


def test_the_control_experiment_gives_twice_the_equivalent_stiffness() -> None:
    mean = make_mean(210e-6, 1.5e4, 0.3)
    hammer = estimate_hammer(mean, SETUP)
    expected = 2 * 0.05 * (np.pi / 210e-6) ** 2  # 97 g and 3 g against 100 g
    assert hammer.stiffness == pytest.approx(expected, rel=1e-4)
    # The same hit, read as a sample's, gives a sample as stiff as the hammer.
    found = estimate_sample("alike", mean, (210e-6,), 0, hammer, SETUP)
    assert found.body.stiffness == pytest.approx(hammer.stiffness, rel=1e-12)


def test_a_hammer_without_a_second_peak_keeps_its_stiffness() -> None:
    hammer = estimate_hammer(make_mean(210e-6, 1.5e4, 0.3), SETUP)
    assert np.isfinite(hammer.stiffness)
    assert np.isnan(hammer.damping_coefficient)
    assert len(hammer.notes) == 1
    assert hammer.notes[0].startswith("c1: no log decrement, since no second peak stands out")


def test_spread_is_that_of_the_hits() -> None:
    mean = make_mean(200e-6, 1.5e4, 0.3)
    times = (199e-6, 200e-6, 201e-6)
    found = estimate_sample("heavy", mean, times, 4, HAMMER, SETUP)
    assert found.contact_time_spread == pytest.approx(1e-6)
    assert (found.impacts_accepted, found.impacts_rejected) == (3, 4)
    single = estimate_sample("heavy", mean, times[:1], 0, HAMMER, SETUP)
    assert np.isnan(single.contact_time_spread)


def test_without_k1_the_damping_ratio_is_still_found() -> None:
    mean = make_mean(200e-6, 1.5e4, 0.3)
    unknown = BodyEstimate(notes=("k1: because",))
    found = estimate_sample("heavy", mean, (200e-6,), 0, unknown, SETUP)
    assert np.isnan(found.body.stiffness)
    assert np.isnan(found.body.damping_coefficient)
    assert found.body.damping_ratio == pytest.approx(0.3, rel=1e-3)
    assert found.body.notes == ("k1: because", "k2: not determined without k1")
    assert found.comparisons == ()


def test_a_contact_too_short_for_k1_is_noted_not_raised() -> None:
    mean = make_mean(100e-6, 1.5e4, 0.3)
    found = estimate_sample("heavy", mean, (100e-6,), 0, HAMMER, SETUP)
    assert np.isnan(found.body.stiffness)
    assert "k2: equation (6b) has no positive solution" in found.body.notes[0]
    assert found.contact is not None
    assert found.contact.contact_time == pytest.approx(100e-6, rel=1e-4)


def test_a_sample_that_was_not_measured_has_no_damping() -> None:
    mean = make_mean(200e-6, 1.5e4, 0.3, channels=1)
    found = estimate_sample("heavy", mean, (200e-6,), 0, HAMMER, SETUP)
    assert np.isfinite(found.body.stiffness)
    assert np.isnan(found.specimen_peak)
    assert found.body.notes == ("c2: the sample's trace was not measured",)


def test_a_sample_that_shows_nothing_has_no_damping() -> None:
    mean = make_mean(200e-6, 1.5e4, 0.3)
    silent = replace(mean, traces=np.stack([mean.traces[0], np.zeros(5000)]))
    found = estimate_sample("heavy", silent, (200e-6,), 0, HAMMER, SETUP)
    assert np.isfinite(found.body.stiffness)
    assert "has no pulse" in found.body.notes[0]


def test_every_sample_is_compared_with_both_forms_of_the_model() -> None:
    mean = make_mean(200e-6, 1.5e4, 0.3)
    found = estimate_sample("heavy", mean, (200e-6,), 0, HAMMER, SETUP)
    driven = found.find_comparison(ModelVariant.DRIVEN)
    printed = found.find_comparison(ModelVariant.PRINTED)
    assert driven is not None
    assert printed is not None
    # The driven hammer is a versed-sine of tau_p, and so is this one.
    assert driven.hammer.mse_percent < 1e-4
    assert printed.hammer.mse_percent > 0.1


def test_the_printed_form_needs_the_hammers_damping() -> None:
    mean = make_mean(200e-6, 1.5e4, 0.3)
    found = estimate_sample("heavy", mean, (200e-6,), 0, BodyEstimate(K1), SETUP)
    assert found.find_comparison(ModelVariant.DRIVEN) is not None
    assert found.find_comparison(ModelVariant.PRINTED) is None


def test_the_impact_speed_is_felt_by_the_printed_form_alone() -> None:
    mean = make_mean(200e-6, 1.5e4, 0.3)
    slow, fast = (
        estimate_sample("heavy", mean, (200e-6,), 0, HAMMER, replace(SETUP, impact_speed=speed))
        for speed in (0.08, 0.8)
    )
    found = {
        variant: [
            compared.specimen.contact_error_percent
            for compared in (slow.find_comparison(variant), fast.find_comparison(variant))
            if compared is not None
        ]
        for variant in ModelVariant
    }
    assert found[ModelVariant.DRIVEN][0] == found[ModelVariant.DRIVEN][1]
    first, second = found[ModelVariant.PRINTED]
    assert abs(first - second) > 1.0


def test_the_control_sample_of_the_paper_gives_its_k1() -> None:
    mean = make_mean(212e-6, 1.5e4, 0.3)
    # 22.54 MN/m is rounded to 0.02 %, and 212.0 us makes it 22.536.
    assert estimate_hammer(mean, PAPER_SETUP).stiffness == pytest.approx(22.54e6, rel=1e-3)


def test_what_stands_beside_the_numbers_changes_none_of_them() -> None:
    mean = make_mean(200e-6, 3e4, 0.3)
    numbers = estimate_numbers("heavy", mean, np.array([200e-6]), 0, HAMMER, SETUP)
    checked = add_checks(numbers, mean, HAMMER, SETUP)
    assert (numbers.shape, numbers.free_decay, numbers.comparisons) == (None, None, ())
    assert checked.shape is not None
    assert checked.comparisons
    assert (checked.contact, checked.body) == (numbers.contact, numbers.body)
    assert set(checked.warnings) >= set(numbers.warnings)
    assert set(checked.notes) >= set(numbers.notes)
