"""Uncertainty of the paper's method: hand-made budgets, Monte Carlo, and what has none."""

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from impact_rig.core.estimates.contact_law import NO_LAW, ContactLaw
from impact_rig.core.estimates.mean_reading import (
    HammerPulse,
    MeanReading,
    compute_shape_error,
    look_at_pulse,
    read_hit,
    read_mean_hit,
)
from impact_rig.core.estimates.paper_method import (
    BodyEstimate,
    HammerEstimate,
    estimate_body,
    estimate_hammer,
    estimate_paper,
)
from impact_rig.core.estimates.pulse_shape import NO_SHAPE
from impact_rig.core.estimates.uncertainty import RigInputs
from impact_rig.core.given.filtering import low_pass
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.setup import PAPER_SETUP, RigSetup
from impact_rig.core.hit.judging import FilteredHit
from impact_rig.core.hit.pulse_width import BY_NOISE, measure_pulse
from impact_rig.core.mean.mean_hit import MeanHit

from ..blocks import average_hits

RATE = 2.5e6
SETUP = replace(PAPER_SETUP, analysis=replace(PAPER_SETUP.analysis, cutoff_frequency=0.0))
CONTROL = SETUP.samples.control_sample
CONTACT_TIMES = {"steel medium": 203.2e-6, CONTROL: 212.0e-6, "aluminium small": 144.8e-6}
RATIO = 0.25
TRIALS = 1_000_000


def make_hit(tau: float, amplitude: float, ratio: float) -> FilteredHit:
    """Return a noiseless hit: a versed-sine, and the free decay of a body from its top on."""
    time = np.arange(5000) / RATE - 300e-6
    phase = time / tau + 0.5
    inside = (phase > 0.0) & (phase < 1.0)
    pulse = np.where(inside, np.sin(np.pi * phase) ** 2, 0.0)
    natural = 1.6e4
    decay, frequency = ratio * natural, natural * math.sqrt(1.0 - ratio**2)
    late = np.maximum(time, 0.0)
    swing = np.cos(frequency * late) + decay / frequency * np.sin(frequency * late)
    tail = np.exp(-decay * late) * swing
    # The hammer's tail, so that it has a second peak.
    rebound = np.where(phase > 1.0, 0.02 * tail, 0.0)
    traces = amplitude * np.stack([pulse + rebound, np.where(time < 0.0, pulse, tail)])
    nothing = np.zeros(2)
    return FilteredHit(traces, RATE, measure_pulse(traces[0]), nothing, nothing, nothing, 400)


@cache
def make_mean(name: str, count: int = 10, scatter: float = 3e-3) -> MeanHit:
    generator = np.random.default_rng(len(name))
    errors = generator.standard_normal((count, 3)) * [scatter, 0.02 * bool(scatter), scatter]
    tau = CONTACT_TIMES[name]
    return average_hits(
        [make_hit(tau * (1 + a), 700.0 * (1 + b), RATIO * (1 + c)) for a, b, c in errors]
    )


def read(mean: MeanHit | None, setup: RigSetup, name: str, inputs: RigInputs) -> MeanReading:
    mean = mean or make_mean(name)
    pulse = look_at_pulse(mean, setup, name)
    return read_mean_hit(mean, setup, inputs.find(name), name, pulse)


@dataclass(frozen=True)
class Estimate:
    """Contact and body of a sample, and the hammer."""

    contact_time: Quantity
    equivalent_stiffness: Quantity
    body: BodyEstimate
    hammer: HammerEstimate


def estimate(name: str, setup: RigSetup = SETUP, mean: MeanHit | None = None) -> Estimate:
    inputs = RigInputs(setup)
    control = read(make_mean(CONTROL), setup, CONTROL, inputs)
    hammer = estimate_hammer(control, setup)
    series = read(mean, setup, name, inputs) if mean or name != CONTROL else control
    return Estimate(
        series.contact_time.state(), *estimate_body(series, setup, name, hammer), hammer
    )


def read_contact_times(mean: MeanHit) -> NDArray[np.float64]:
    return np.array([2.0 * hit.pulse.half_amplitude_width / RATE for hit in mean.hits])


def find_line(uncertainty: Quantity, source: str) -> float:
    return next(line.contribution for line in uncertainty.budget if line.source == source)


def test_the_budget_of_the_equivalent_stiffness_is_what_the_formula_says():
    contact = estimate("steel medium")
    found, k = contact.equivalent_stiffness, contact.equivalent_stiffness.value
    m1, m2 = 0.100, 0.16991
    # k = m1 m2 / (m1 + m2) (pi / tau)^2: d ln k / d ln m1 = m2 / (m1 + m2), and so on.
    expected = {
        "scatter of the hits on steel medium": 2
        * np.std(read_contact_times(make_mean("steel medium")), ddof=1)
        / math.sqrt(10)
        / contact.contact_time.value,
        "mass of the hammer": m2 / (m1 + m2) * 0.29e-3 / m1,
        "mass of the accelerometer": m1 / (m1 + m2) * 0.29e-3 / m2,
        "mass of steel medium": m1 / (m1 + m2) * 0.0029e-3 / m2,
        "sampling clock": 2 * 5.8e-5,
    }
    for source, part in expected.items():
        assert find_line(found, source) / k == pytest.approx(part, rel=1e-3), source


def draw_masses(generator: np.random.Generator) -> dict[str, NDArray[np.float64]]:
    accelerometer = 3e-3 + 0.29e-3 * generator.standard_normal(TRIALS)
    masses = {
        sample.name: sample.mass + accelerometer + 0.0029e-3 * generator.standard_normal(TRIALS)
        for sample in SETUP.samples.samples
        if sample.name in CONTACT_TIMES
    }
    masses["hammer"] = 0.1 + 0.29e-3 * generator.standard_normal(TRIALS)
    return masses


@pytest.mark.parametrize("name", ["steel medium", "aluminium small", CONTROL])
def test_monte_carlo_gives_the_same_interval(name):
    """GUM Supplement 1, section 8: both ends within the tolerance of one digit of u.

    All inputs normal, so that the propagation is tested and not Student's t, for which Welch
    and Satterthwaite's interval and the Supplement's differ by nature.
    """
    body = estimate(name).body
    generator = np.random.default_rng(11)
    masses = draw_masses(generator)
    clock = 1.0 + SETUP.clock_uncertainty * generator.standard_normal(TRIALS)
    reduced = {
        key: masses["hammer"] * masses[key] / (masses["hammer"] + masses[key])
        for key in {name, CONTROL}
    }
    times = {}
    for key in sorted({name, CONTROL}):
        hits = read_contact_times(make_mean(key))
        spread = np.std(hits, ddof=1) / math.sqrt(hits.size)
        centre = 2.0 * measure_pulse(make_mean(key).traces[0]).half_amplitude_width / RATE
        times[key] = (centre + spread * generator.standard_normal(TRIALS)) * clock
    k = {key: reduced[key] * (np.pi / times[key]) ** 2 for key in times}
    k1 = 2.0 * k[CONTROL]
    k2 = 1.0 / (1.0 / k[name] - 1.0 / k1)
    found = body.stiffness
    tolerance = 0.5 * 10.0 ** math.floor(math.log10(found.standard))
    half = 1.960 * found.standard
    low, high = np.quantile(k2, [0.025, 0.975])
    assert low == pytest.approx(body.stiffness.value - half, abs=tolerance)
    assert high == pytest.approx(body.stiffness.value + half, abs=tolerance)
    # What is not linear shifts the ends by up to 3 % of u; 10^6 trials know them to 0.3 %.
    assert low == pytest.approx(body.stiffness.value - half, abs=0.05 * found.standard)
    assert high == pytest.approx(body.stiffness.value + half, abs=0.05 * found.standard)


def test_damping_comes_from_correlated_hits():
    body = estimate("steel medium").body
    mean = make_mean("steel medium")
    generator = np.random.default_rng(12)
    # Independent of the estimate: zeta of every hit from its own two highest peaks.
    ratios = []
    for hit in mean.hits:
        trace = hit.traces[1] / hit.traces[1].max()
        tail = trace[1000:]
        delta = -math.log(tail.max())
        ratios.append(delta / math.hypot(2.0 * math.pi, delta))
    expected = np.std(ratios, ddof=1) / math.sqrt(10)
    assert body.damping_ratio.standard == pytest.approx(expected, rel=0.02)
    assert body.damping_ratio.degrees_of_freedom == pytest.approx(9.0, rel=0.01)
    # c = 2 zeta sqrt(k m) by Monte Carlo, zeta and tau_p drawn together.
    masses = draw_masses(generator)
    taus = read_contact_times(mean)
    joint = generator.multivariate_normal(
        [taus.mean(), np.mean(ratios)], np.cov(taus, ratios) / 10, TRIALS
    )
    control = read_contact_times(make_mean(CONTROL))
    other = generator.normal(control.mean(), np.std(control, ddof=1) / math.sqrt(10), TRIALS)
    m1, m2, mc = masses["hammer"], masses["steel medium"], masses[CONTROL]
    k_eq = m1 * m2 / (m1 + m2) * (np.pi / joint[:, 0]) ** 2
    k1 = 2.0 * m1 * mc / (m1 + mc) * (np.pi / other) ** 2
    c2 = 2.0 * joint[:, 1] * np.sqrt(m2 / (1.0 / k_eq - 1.0 / k1))
    assert body.damping_coefficient.standard == pytest.approx(c2.std(), rel=0.02)


def test_one_hit_has_its_own_uncertainty_and_no_damping():
    single = make_mean("steel medium", 1)
    contact = estimate("steel medium", mean=single)
    body = contact.body
    assert math.isfinite(body.stiffness.value)
    alone = read_hit(single.hits[0], SETUP, "steel medium").contact_time.state()
    assert contact.contact_time.standard == pytest.approx(alone.standard, rel=0.01)
    assert body.stiffness.standard > 0.0
    for found in (body.damping_ratio, body.damping_coefficient):
        assert math.isnan(found.standard)
        assert "one accepted hit shows no scatter" in str(found.notes[0])


def test_a_hammer_stiffness_without_uncertainty_is_taken_as_exact():
    given = BodyEstimate(Quantity(22e6))
    reading = read(None, SETUP, "steel medium", RigInputs(SETUP))
    found = estimate_paper("steel medium", reading, math.nan, given, SETUP)
    assert found.contact_time.is_known
    part = found.equivalent_stiffness.standard
    gain = (found.stiffness.value / found.equivalent_stiffness.value) ** 2
    assert found.stiffness.standard == pytest.approx(gain * part)


def test_masses_without_stated_uncertainty_are_named():
    silent = replace(SETUP, hammer_mass_uncertainty=0.0)
    contact = estimate("steel medium", silent)
    body, hammer = contact.body, contact.hammer
    for found in (
        contact.equivalent_stiffness,
        body.stiffness,
        body.damping_coefficient,
        hammer.stiffness,
    ):
        assert math.isfinite(found.standard)
        assert "mass of the hammer, assumed" in {line.source for line in found.budget}
        assert "the mass of the hammer within 0.5 %, standard, since" in str(found.notes[-1])
    assert contact.contact_time.notes == ()


def test_a_converters_steps_count_where_no_noise_smooths_them():
    mean = make_mean("steel medium")
    coarse = replace(mean, largest_step=np.array([5.0, 5.0]))
    contact, fine = estimate("steel medium", mean=coarse), estimate("steel medium")
    body = contact.body
    assert contact.contact_time.standard > fine.contact_time.standard
    # Two crossings at pi A / tau, and a level at half a wrong peak.
    step = 5.0 / math.sqrt(12)
    slope = math.pi * 700.0 / contact.contact_time.value
    expected = 2.0 * step / slope * math.sqrt(2.0 + 1.0)
    assert find_line(contact.contact_time, "quantisation") == pytest.approx(expected, rel=0.02)
    assert "quantisation of the peaks" in {line.source for line in body.damping_ratio.budget}


def test_a_single_hits_contact_time_has_an_uncertainty_of_its_own():
    hit = replace(make_hit(200e-6, 700.0, RATIO), noise=np.full(2, 2.0), raw_noise=np.full(2, 2.0))
    found = read_hit(hit, SETUP, "steel medium").contact_time.state()
    sources = {line.source: line.contribution for line in found.budget}
    assert set(sources) >= {"noise", "zero of the baseline", "sampling clock", "sampling"}
    slope = math.pi * 700.0 / 200e-6
    assert sources["noise"] == pytest.approx(2.0 * 2.0 / slope * math.sqrt(3.0), rel=0.02)
    # One hit repeats nothing: no type A, and the normal factor.
    assert {line.kind for line in found.budget} == {"B"}
    assert found.expanded == pytest.approx(1.96 * found.standard, rel=1e-3)


@pytest.mark.parametrize(("scatter", "part"), [(0.0, 1.0), (0.003, 0.0)])
def test_hits_that_scatter_less_than_their_noise_keep_it_in_the_budget(scatter, part):
    """As copies of one hit do, rounded or shifted, or a few hits by chance."""
    noise = {"noise": np.full(2, 0.2), "raw_noise": np.full(2, 0.2)}
    mean = replace(make_mean("steel medium", scatter=scatter), **noise)
    found, alone = (
        read(item, SETUP, "steel medium", RigInputs(SETUP)).contact_time.state()
        for item in (mean, replace(mean, hits=mean.hits[:1]))
    )
    of_noise = [
        sum(line.contribution**2 for line in item.budget if line.source in BY_NOISE)
        for item in (found, alone)
    ]
    assert of_noise[0] == pytest.approx(part * of_noise[1], abs=0.0)


FORM = HammerPulse(shape=replace(NO_SHAPE, possible=("versed-sine",), unexplained=0.0), law=NO_LAW)
"""Of pulses that are known to be versed-sines."""
NAME = "steel medium"
STILL = make_mean(NAME, scatter=0.0)


def add_drift(mean: MeanHit) -> MeanHit:
    line = np.arange(mean.traces.shape[1]) - (mean.baseline_points - 1) / 2.0
    return replace(mean, traces=mean.traces + 2e-3 * line)


def keep_every_fiftieth_point(mean: MeanHit) -> MeanHit:
    return replace(
        mean, traces=mean.traces[:, 17::50], sampling_rate=RATE / 50, baseline_points=8, hits=()
    )


def send_through_low_pass(mean: MeanHit) -> MeanHit:
    return replace(mean, traces=low_pass(mean.traces, 12e3, RATE))


def add_noise_to_tops(mean: MeanHit) -> MeanHit:
    """Add noise where peaks are read, and nowhere else: flanks stay, so that it alone is seen."""
    noise = 2.0
    random = noise * np.random.default_rng(4).standard_normal(mean.traces.shape)
    is_top = np.zeros(mean.traces.shape, dtype=bool)
    is_top[0] = mean.traces[0] > 0.9 * mean.traces[0].max()
    second = 300e-6 + 2.0 * np.pi / (1.6e4 * math.sqrt(1.0 - RATIO**2))
    is_top[1] = abs(np.arange(mean.traces.shape[1]) / RATE - second) < 30e-6
    return replace(
        mean, traces=mean.traces + np.where(is_top, random, 0.0), noise=np.full(2, noise)
    )


@pytest.mark.parametrize(
    ("spoil", "number", "source", "cutoff"),
    [
        (add_drift, "contact time", "trend of the baseline", 0.0),
        (add_drift, "decrement", "trend of the baseline", 0.0),
        (keep_every_fiftieth_point, "contact time", "sampling", 0.0),
        (send_through_low_pass, "contact time", "low-pass", 12e3),
        (add_noise_to_tops, "contact time", "peak reading", 0.0),
        (add_noise_to_tops, "decrement", "second peak reading", 0.0),
    ],
)
def test_without_a_line_of_its_budget_the_truth_falls_outside(spoil, number, source, cutoff):
    setup = replace(SETUP, analysis=replace(SETUP.analysis, cutoff_frequency=cutoff))
    rig = RigInputs(setup).find(NAME)
    found, true = (
        {"contact time": item.contact_time, "decrement": item.decrements[1][1]}[number].state()
        for item in (read_mean_hit(mean, setup, rig, NAME, FORM) for mean in (spoil(STILL), STILL))
    )
    away = abs(found.value - true.value)
    # Hits that do not scatter have their noise in the budget, which this is not about.
    known = [line.contribution for line in found.budget if line.source in (source, *BY_NOISE)]
    rest = math.sqrt(max(found.standard**2 - sum(part**2 for part in known), 0.0))
    assert 2.0 * rest < away <= 2.0 * found.standard


@pytest.mark.parametrize("duration", [90e-6, 95e-6, 105e-6, 110e-6])
def test_the_error_by_the_shape_reaches_the_laws_duration_on_either_side(duration):
    law = ContactLaw(duration=Quantity(duration, 1e-7, 2e-7), residual_percent=0.3)
    spread, own = compute_shape_error(HammerPulse(NO_SHAPE, law), 1e-4, 50e-6, 100e-6)
    # A rectangle from tau_p to the law's duration at least: half of it over the root of 3.
    assert math.copysign(1.0, spread) == math.copysign(1.0, duration - 100e-6)
    assert abs(spread) > abs(duration - 100e-6) / math.sqrt(3.0)
    assert own == 1e-7
