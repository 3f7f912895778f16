"""From mean traces to tau_p, k and c: known bodies are found again, gaps in knowledge named.

What contradicts the paper's method is said, and what does not is not.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import StateSpace, impulse

from impact_rig.core.estimates.equations import estimate_damping_coefficient
from impact_rig.core.estimates.mean_reading import UNSEEN, MeanReading, read_mean_hit
from impact_rig.core.estimates.paper_method import (
    STEPS,
    BodyEstimate,
    estimate_hammer,
    estimate_paper,
)
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.estimates.uncertainty import RigInputs
from impact_rig.core.given.findings import Note, Subject
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import PAPER_SETUP, AnalysisSettings, RigSetup, Sample, SampleSet
from impact_rig.core.hit.judging import FilteredHit
from impact_rig.core.hit.pulse_width import measure_pulse
from impact_rig.core.mean import mean_hit
from impact_rig.core.mean.mean_hit import MeanHit
from impact_rig.core.session import Session
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import DigitizerSettings, VirtualRig, VirtualRigSettings

RATE = 2.5e6
ORIGIN = 754
K1 = 22e6
HAMMER = BodyEstimate(Quantity(K1), Quantity(0.623), Quantity(1848.0), 5.0)
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
    return mean_hit.make_mean(
        mean_hit.TraceSum(3.0 * traces, ORIGIN), [mean_hit.shift_hit(hit)] * 3
    )


def read(mean: MeanHit, setup: RigSetup, sample: str) -> MeanReading:
    """Return the reading of a mean hit whose pulse is not looked at."""
    return read_mean_hit(mean, setup, RigInputs(setup).find(sample), sample, UNSEEN)


@given(stiffness=st.floats(10e6, 60e6), ratio=st.floats(0.15, 0.5), mass=st.floats(0.02, 0.4))
def test_a_known_sample_is_found_again(stiffness, ratio, mass):
    setup = replace(SETUP, samples=SampleSet((Sample("x", mass),), "", 3e-3))
    moving = mass + 3e-3
    m_eq = 0.1 * moving / (0.1 + moving)
    tau = np.pi * np.sqrt(m_eq * (1 / K1 + 1 / stiffness))
    mean = make_mean(tau, np.sqrt(stiffness / moving), ratio)
    found = estimate_paper("x", read(mean, setup, "x"), np.nan, HAMMER, setup)
    assert found.contact_time.is_known
    # Interpolated crossings of some 250 points: 1e-5.
    assert found.contact_time.value == pytest.approx(tau, rel=1e-4)
    # k2 is a difference: what tau_p lacks counts up to 2 (1 + k2 / k1) = 8 times.
    assert found.stiffness.value == pytest.approx(stiffness, rel=1e-3)
    assert found.damping_ratio.value == pytest.approx(ratio, rel=1e-3)
    expected = estimate_damping_coefficient(ratio, stiffness, moving)
    assert found.damping_coefficient.value == pytest.approx(expected, rel=2e-3)
    assert found.hammer_peak == pytest.approx(900.0, rel=1e-3)
    assert found.specimen_peak == pytest.approx(300.0, rel=1e-3)
    assert not any(note.about in {Subject.K2, Subject.C2} for note in found.notes)


def test_the_peak_force_is_the_hammers_mass_times_its_largest_acceleration():
    mean = make_mean(200e-6, 1.5e4, 0.3)
    known = replace(SETUP, hammer_mass_uncertainty=1e-3)
    reading = read(mean, known, "heavy")
    found = estimate_paper("heavy", reading, np.nan, HAMMER, known).peak_force
    assert found.value == pytest.approx(0.1 * 900.0, rel=1e-4)
    # Three hits alike: 1 % of the mass, and 3 % of a gain that nothing states.
    assert found.standard == pytest.approx(np.hypot(0.01, 0.03) * found.value, rel=1e-6)
    assert [line.source for line in found.budget] == [
        "gain of the hammer's channel, assumed",
        "mass of the hammer",
    ]


def test_the_pulse_factor_scales_contact_time_and_stiffness():
    mean = make_mean(200e-6, 1.5e4, 0.3)
    sine = replace(SETUP, analysis=replace(SETUP.analysis, pulse_factor=1.5))
    one, other = (
        estimate_paper("heavy", read(mean, setup, "heavy"), np.nan, HAMMER, setup)
        for setup in (SETUP, sine)
    )
    widths = [item.half_amplitude_width.value for item in (other, one)]
    assert widths[0] == pytest.approx(widths[1], rel=1e-12)
    assert other.contact_time.value == pytest.approx(0.75 * one.contact_time.value)
    # k goes with F^-2: a half-sine read with F = 2 gives 0.5625 k.
    assert one.equivalent_stiffness.value == pytest.approx(
        0.5625 * other.equivalent_stiffness.value
    )


def test_the_control_experiment_gives_twice_the_equivalent_stiffness():
    mean = make_mean(210e-6, 1.5e4, 0.3)
    reading = read(mean, SETUP, "alike")
    hammer = estimate_hammer(reading, SETUP)
    expected = 2 * 0.05 * (np.pi / 210e-6) ** 2  # 97 g and 3 g against 100 g
    assert hammer.stiffness.value == pytest.approx(expected, rel=1e-4)
    # The same hit, read as a sample's, gives a sample as stiff as the hammer.
    found = estimate_paper("alike", reading, np.nan, hammer, SETUP)
    assert found.stiffness.value == pytest.approx(hammer.stiffness.value, rel=1e-12)


def test_a_contact_too_short_for_k1_is_noted_not_raised():
    mean = make_mean(100e-6, 1.5e4, 0.3)
    found = estimate_paper("heavy", read(mean, SETUP, "heavy"), np.nan, HAMMER, SETUP)
    assert np.isnan(found.stiffness.value)
    assert "k2: equation (6b) has no positive solution" in str(found.notes[0])
    assert found.contact_time.is_known
    assert found.contact_time.value == pytest.approx(100e-6, rel=1e-4)


def test_a_sample_that_was_not_measured_has_no_damping():
    mean = make_mean(200e-6, 1.5e4, 0.3, channels=1)
    found = estimate_paper("heavy", read(mean, SETUP, "heavy"), np.nan, HAMMER, SETUP)
    assert np.isfinite(found.stiffness.value)
    assert np.isnan(found.specimen_peak)
    assert found.notes[0] == Note(Subject.C2, "the sample's trace was not measured")


SAMPLE = "aluminium large"


def strike(
    settings: VirtualRigSettings, truth: RigSetup = PAPER_SETUP, stated: RigSetup = PAPER_SETUP
) -> SampleEstimate:
    """Return the estimate of the control sample after five hits."""
    rig, session = VirtualRig(truth, settings), Session(stated)
    for impact in range(1, 6):
        for block in rig.strike(HitLabel(SAMPLE, impact, impact)).split(5000, 0):
            session.feed(block)
    (estimate,) = session.estimate_all().samples
    return estimate


@pytest.mark.parametrize("noise", [0.0, 5e-4])
def test_steps_larger_than_the_noise_are_named(noise):
    # A step of ten bits is 1/512 of full scale.
    digitizer = DigitizerSettings(bits=10, noise=noise)
    assert STEPS in strike(VirtualRigSettings(digitizer=digitizer)).warnings


def test_a_control_sample_of_another_mass_is_named_with_both_masses():
    heavy = replace(PAPER_SETUP, hammer_mass=0.15)
    (warning,) = strike(VirtualRigSettings(), heavy, heavy).warnings
    assert warning.explanation.startswith(
        "the control sample 'aluminium large' of 105.4 g is not alike to the hammer of 150 g"
    )


def test_a_versed_sine_keeps_its_interval():
    for plant in (Plant.PUBLISHED, Plant.DYNAMICS):
        found = strike(VirtualRigSettings(plant=plant))
        assert "shape of the pulse" not in {
            line.source for line in found.paper.contact_time.budget
        }
        assert found.paper.contact_time.expanded < 0.004 * found.paper.contact_time.value
        assert not any("versed-sine" in str(warning) for warning in found.warnings)


@pytest.mark.parametrize("shared", [True, False])
def test_a_second_peak_that_is_no_decay_of_the_body_gives_no_damping(*, shared):
    mean = make_mean(210e-6, 1.5e4, 0.2)
    pulse = mean.traces[0]
    second = 0.04 * np.roll(pulse, 1500)
    traces = np.stack([pulse + shared * second, (pulse + second) / -3.0])
    with_second = replace(mean, traces=traces)
    reading = read(with_second, SETUP, "heavy")
    numbers = estimate_paper("heavy", reading, 0.0, HAMMER, SETUP)
    assert not numbers.damping_ratio.is_known
    why = "the force on both bodies has it" if shared else "would swing to the other side"
    assert any("no decay of the body" in note and why in note for note in map(str, numbers.notes))
