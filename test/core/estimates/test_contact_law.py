"""The contact law is found again from traces of two bodies whose motion was integrated."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from impact_rig.core.estimates.contact_law import ContactLaw, estimate_contact_law
from impact_rig.core.given.errors import NotDeterminedError
from impact_rig.core.given.filtering import low_pass
from impact_rig.core.given.findings import Note, Subject, join_findings
from impact_rig.core.given.records import FloatArray, HitLabel
from impact_rig.core.given.sensors import CHANNELS, Sensor
from impact_rig.core.given.setup import AnalysisSettings, RigSetup, Sample, SampleSet
from impact_rig.core.hit.judging import FilteredHit
from impact_rig.core.hit.pulse_width import measure_pulse
from impact_rig.core.mean.mean_hit import MeanHit

from ..blocks import average_hits
from ..contacts import find_loss, strike_body
from ..struck import COUNT, HAMMER, RATE, SAMPLE, SPEED, START, Impact

CUTOFF = 50e3
BOTH = HAMMER * SAMPLE / (HAMMER + SAMPLE)
DURATION = 212e-6
NOISE = 2.0
"""Of the virtual rig's digitizer, 1e-3 of 2000 m/s^2."""
BASELINE = 400
SETUP = RigSetup(
    SampleSet((Sample("steel", SAMPLE, mass_uncertainty=0.29e-3),), ""),
    hammer_mass=HAMMER,
    impact_speed=np.nan,
    hammer_mass_uncertainty=0.29e-3,
)

every_law = pytest.mark.parametrize(
    ("exponent", "restitution"),
    [(n, e) for n in (1.0, 1.5, 2.0) for e in (1.0, 0.9, 0.7, 0.5)],
)
corner_laws = pytest.mark.parametrize(
    ("exponent", "restitution"), [(1.0, 1.0), (1.0, 0.5), (1.5, 0.9), (2.0, 1.0), (2.0, 0.5)]
)


@dataclass(frozen=True)
class Contact:
    """A contact with its truth."""

    stiffness: float
    alpha: float
    traces: FloatArray


def strike(exponent: float, restitution: float) -> Contact:
    """Return a contact of `struck`, and what its law is in SI units."""
    loss = find_loss(exponent, restitution)
    motion = strike_body(exponent, loss)
    unit = DURATION / motion.time[-1]
    force = Impact(DURATION, exponent, restitution).find_force(np.arange(COUNT) / RATE - START)
    return Contact(
        stiffness=BOTH * SPEED ** (1.0 - exponent) / unit ** (exponent + 1.0),
        alpha=loss / SPEED,
        traces=np.outer((1.0, -HAMMER / SAMPLE), force),
    )


def make_hit(traces: FloatArray, noise: float, generator: np.random.Generator) -> FilteredHit:
    raw = traces + noise * generator.standard_normal(traces.shape)
    raw -= raw[:, :BASELINE].mean(axis=1, keepdims=True)
    filtered = low_pass(raw, CUTOFF, RATE)
    return FilteredHit(
        filtered,
        RATE,
        measure_pulse(filtered[0]),
        filtered[:, :BASELINE].std(axis=1),
        raw[:, :BASELINE].std(axis=1, ddof=1),
        np.zeros(len(raw)),
        BASELINE,
    )


def make_mean(traces: FloatArray, noise: float = 0.0, hits: int = 1, seed: int = 1) -> MeanHit:
    generator = np.random.default_rng(seed)
    return average_hits([make_hit(traces, noise, generator) for _ in range(hits)])


def estimate(mean: MeanHit, exponent: float = 0.0, sensors: tuple[Sensor, ...] = ()) -> ContactLaw:
    settings = AnalysisSettings(contact_exponent=exponent)
    setup = replace(SETUP, analysis=settings, sensors=sensors)
    return estimate_contact_law(mean, setup, "steel")


@every_law
def test_without_noise_the_law_is_found_again(exponent, restitution):
    contact = strike(exponent, restitution)
    law = estimate(make_mean(contact.traces))
    assert law.exponent.value == pytest.approx(exponent, abs=0.002)
    assert law.restitution.value == pytest.approx(restitution, abs=0.001)
    assert law.duration.value == pytest.approx(DURATION, rel=0.001)
    assert law.impact_speed.value == pytest.approx(SPEED, rel=0.002)
    if restitution < 1.0:
        assert law.damping.value == pytest.approx(contact.alpha, rel=0.002, abs=0.005)
    assert np.log(law.stiffness.value) == pytest.approx(np.log(contact.stiffness), abs=0.02)
    assert law.peak_force.value == pytest.approx(HAMMER * contact.traces[0].max(), rel=0.001)
    assert law.impulse.value == pytest.approx(BOTH * SPEED * (1.0 + restitution), rel=0.002)
    energy = BOTH * SPEED**2 * (1.0 - restitution**2) / 2.0
    assert law.energy_loss.value == pytest.approx(energy, rel=0.004, abs=4e-7)
    equivalent = BOTH * (np.pi / DURATION) ** 2
    assert law.equivalent_stiffness.value == pytest.approx(equivalent, rel=0.002)
    # Without loss any form of it describes the pulse.
    assert law.notes == () or restitution == 1.0


def send_through_chain(exponent: float, restitution: float, seed: int) -> MeanHit:
    """Average ten hits that came through resonance, noise, hum and twelve bits."""
    generator = np.random.default_rng(seed)
    raw = [
        Impact(DURATION, exponent, restitution, hum=1e-3, seed=10 * seed + hit).measure()
        for hit in range(10)
    ]
    return average_hits([make_hit(traces, 0.0, generator) for traces in raw])


@corner_laws
def test_through_the_whole_chain_duration_and_restitution_are_within_a_per_cent(
    exponent, restitution
):
    mean = send_through_chain(exponent, restitution, 3)
    sensors = tuple(Sensor(name, resonance=70e3, resonance_damping=0.02) for name in CHANNELS)
    law = estimate(mean, sensors=sensors)
    assert abs(law.duration.value - DURATION) < 1.5 * law.duration.expanded
    assert law.duration.value == pytest.approx(DURATION, rel=0.0025)
    assert law.restitution.value == pytest.approx(restitution, abs=0.003)
    assert law.exponent.value == pytest.approx(exponent, abs=0.01)


def test_a_resonance_that_nothing_states_is_found_where_it_rings_behind_the_pulse():
    law = estimate(send_through_chain(1.5, 0.9, 3))
    for quantity, true in ((law.duration, DURATION), (law.restitution, 0.9)):
        assert abs(quantity.value - true) < quantity.expanded < 0.06 * true
    assert law.restitution.value == pytest.approx(0.9, rel=0.02)
    assert "a sensor that rings at 70 kHz is found" in join_findings(law.notes)
    silent = estimate(make_mean(strike(1.5, 0.9).traces, NOISE))
    assert "that rings" not in join_findings(silent.notes)


def test_what_is_unsure_of_the_sensor_is_in_the_budget_and_the_interval_covers():
    mean = send_through_chain(1.5, 0.9, 5)
    # The sheet is one standard uncertainty off.
    sensor = Sensor(
        "hammer", resonance=65e3, resonance_uncertainty=5e3, sensitivity_uncertainty=0.02
    )
    law = estimate(mean, sensors=(sensor,))
    assert abs(law.duration.value - DURATION) < law.duration.expanded
    assert law.duration.value == pytest.approx(DURATION, rel=0.01)
    lines = {line.source: line.contribution for line in law.duration.budget}
    assert lines["resonance of the hammer's sensor"] > 0.0
    assert "mass of the hammer" not in lines
    assert {line.source for line in law.impact_speed.budget} >= {
        "scatter of the hits on steel",
        "mass of the hammer",
        "mass of steel",
        "sampling clock",
    }
    force = {line.source: line.contribution for line in law.peak_force.budget}
    assert force["gain of the hammer's channel"] == pytest.approx(
        0.02 * law.peak_force.value, rel=0.01
    )


def test_a_given_exponent_makes_the_rest_more_certain():
    mean = make_mean(strike(1.5, 0.7).traces, NOISE)
    free, fixed = estimate(mean), estimate(mean, 1.5)
    assert fixed.exponent.value == 1.5
    assert fixed.exponent.standard == 0.0
    assert fixed.duration.standard < free.duration.standard / 2.0
    assert fixed.duration.value == pytest.approx(DURATION, rel=0.001)
    assert fixed.notes == (Note(Subject.CONTACT_LAW, "n was given, 1.5, not found"),)


def test_without_masses_the_hammer_alone_says_what_it_can():
    contact = strike(1.5, 0.9)
    unknown = replace(SETUP, samples=SampleSet((Sample("steel", np.nan),), ""))
    law = estimate_contact_law(make_mean(contact.traces[:1]), unknown, "steel")
    assert law.duration.value == pytest.approx(DURATION, rel=0.001)
    assert law.restitution.value == pytest.approx(0.9, abs=0.001)
    assert law.peak_force.value == pytest.approx(HAMMER * contact.traces[0].max(), rel=0.001)
    assert law.impulse.is_known
    assert not law.impact_speed.is_known
    assert not law.stiffness.is_known
    assert "the mass of sample is not known" in str(law.notes[0])


def label_hits(traces: list[FloatArray]) -> MeanHit:
    generator = np.random.default_rng(2)
    return average_hits(
        [
            replace(make_hit(trace, NOISE, generator), label=HitLabel("steel", 1, impact, 1))
            for impact, trace in enumerate(traces, start=1)
        ]
    )


def test_a_hit_whose_pulse_is_another_is_named():
    good = strike(1.5, 0.9).traces
    twice = good + 0.1 * np.roll(good, 300, axis=1)
    law = estimate(label_hits([good, good, good, good, twice, good]))
    assert "the pulse of hit 5.1 is of another contact" in join_findings(law.warnings)
    assert estimate(label_hits([good] * 6)).warnings == ()


def test_too_few_points_are_not_fitted():
    mean = make_mean(strike(1.5, 0.9).traces)
    coarse = replace(
        mean, traces=mean.traces[:, ::100], sampling_rate=RATE / 100, origin=0, hits=()
    )
    with pytest.raises(NotDeterminedError, match="sample faster"):
        estimate_contact_law(coarse, SETUP, "steel")
