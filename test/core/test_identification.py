"""The model's parameters are found again from its traces, as well as noise allows."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.signal import lsim

from impact_rig.core.errors import NotDeterminedError, SignalError
from impact_rig.core.filtering import low_pass
from impact_rig.core.fitted_model import fit_model
from impact_rig.core.hits import FilteredHit, MeanHit, average_hits, judge_hit
from impact_rig.core.identification import (
    NAMES,
    Identification,
    identify_model,
)
from impact_rig.core.model import Body, ImpactModel, ModelVariant, simulate_impact
from impact_rig.core.sensors import CHANNELS, Sensor, SensorResponse
from impact_rig.core.setup import PAPER_SETUP, RigSetup
from impact_rig.devices.virtual.plants import make_nominal_model

from .blocks import make_plain_mean, make_record

RATE = 2.5e6
COUNT = 5000
START = 0.2e-3
"""Of the contact, from the first point [s]."""
FINE = 15
"""Points that are simulated per point of a record."""


SAMPLE = "steel medium"
MAIN = ("tau_p", "k2", "c2")


def find_truth(sample: str) -> ImpactModel:
    return make_nominal_model(PAPER_SETUP, sample)


def find_true_values(model: ImpactModel) -> dict[str, float]:
    return {
        "tau_p": model.contact_time,
        "k2": model.specimen.stiffness,
        "c2": model.specimen.damping_coefficient,
        "F0": model.peak_force,
        "sample gain": 1.0,
    }


def strike(
    model: ImpactModel,
    noise: float = 0.0,
    seed: int = 0,
    *,
    gains: tuple[float, float] = (1.0, 1.0),
    start: float = START,
    setup: RigSetup = PAPER_SETUP,
) -> FilteredHit:
    """Judge one hit in white noise, its standard deviation as part of each trace's peak."""
    # Every point is the mean over one sampling step.
    first = -start - (FINE // 2) / FINE / RATE
    fine = np.stack(
        simulate_impact(model, FINE * RATE, FINE * COUNT, start=first, variant=ModelVariant.DRIVEN)
    )
    traces = fine.reshape(2, COUNT, FINE).mean(axis=2)
    traces *= np.array(gains)[:, np.newaxis]
    peaks = np.abs(traces).max(axis=1, keepdims=True)
    source = np.random.default_rng(seed)
    raw = traces + noise * peaks * source.standard_normal(traces.shape)
    pulse_index = int(np.argmax(np.abs(traces[0]) > 0.1 * peaks[0]))
    record = make_record(*raw, pulse_index=pulse_index, full_scale=0.0, rate=RATE)
    judged = judge_hit(record, setup.analysis)
    assert judged.filtered is not None, judged.rejections
    return judged.filtered


def strike_mean(model: ImpactModel, noise: float = 0.0, seed: int = 0, **how) -> MeanHit:
    return average_hits([strike(model, noise, seed, **how)])


def check_found(
    found: Identification, model: ImpactModel, rel: float, names: tuple[str, ...] = MAIN
) -> None:
    truth = find_true_values(model)
    for name in names:
        assert found.find(name) == pytest.approx(truth[name], rel=rel), name


def test_traces_of_an_integrator_give_the_integrated_parameters():
    # An oracle that has nothing of the closed form.
    tau, mass, k, c, force = 200e-6, 0.17, 45e6, 1500.0, 90.0
    time = np.arange(COUNT) / RATE - START

    def push(t: float) -> float:
        return force * np.sin(np.pi * t / tau) ** 2 if 0.0 < t < tau else 0.0

    def move(t: float, y: np.ndarray) -> list[float]:
        return [y[1], (push(t) - c * y[1] - k * y[0]) / mass]

    path = solve_ivp(
        move, (0, time[-1]), [0, 0], method="DOP853", rtol=1e-10, atol=1e-17, max_step=5e-6,
        t_eval=time[time >= 0],
    )  # fmt: skip
    traces = np.zeros((2, COUNT))
    traces[0] = [-push(t) / 0.1 for t in time]
    traces[1, time >= 0] = [move(t, y)[1] for t, y in zip(path.t, path.y.T, strict=True)]
    mean = make_plain_mean(low_pass(traces, 50e3, RATE), RATE, 750)
    samples = replace(PAPER_SETUP.samples, accelerometer_mass=mass - 0.16691)
    found = identify_model(mean, replace(PAPER_SETUP, samples=samples), SAMPLE)
    expected = {"tau_p": tau, "t0": START, "k2": k, "c2": c, "F0": force, "sample gain": 1.0}
    for name, value in expected.items():
        assert found.find(name) == pytest.approx(value, rel=1e-6), name
    assert found.hit_values.shape == (0, len(NAMES))
    assert not found.undetermined


@given(
    frequency=st.floats(1.5, 10.0),
    ratio=st.floats(0.02, 1.2),
    tau=st.floats(80e-6, 300e-6),
    polarity=st.sampled_from([(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]),
)
@settings(max_examples=15, deadline=None)
def test_any_sample_is_found_again_from_its_traces_alone(frequency, ratio, tau, polarity):
    mass = PAPER_SETUP.samples.get_moving_mass(SAMPLE)
    natural = frequency / tau
    body = Body(mass, mass * natural**2, 2 * ratio * mass * natural)
    model = replace(find_truth(SAMPLE), contact_time=tau, specimen=body)
    found = identify_model(strike_mean(model, gains=polarity), PAPER_SETUP, SAMPLE)
    check_found(found, model, 1e-4)
    assert np.sign(found.find("F0")) == polarity[0]
    assert found.find("sample gain") == pytest.approx(polarity[0] * polarity[1], rel=1e-4)
    assert found.force_balance == pytest.approx(1.0, rel=1e-4)


def test_noise_does_what_the_covariance_says():
    model, noise = find_truth(SAMPLE), 3e-3
    runs = [
        identify_model(strike_mean(model, noise, seed), PAPER_SETUP, SAMPLE) for seed in range(60)
    ]
    # Start and offsets have been moved by aligning and by the baseline, before.
    chosen = [NAMES.index(name) for name in (*MAIN, "F0", "sample gain")]
    values = np.array([run.values[chosen] for run in runs])
    stated = np.mean([run.covariance[np.ix_(chosen, chosen)] for run in runs], axis=0)
    size = np.sqrt(np.diag(stated))
    # 60 runs know a standard deviation to 9 %: three of them.
    np.testing.assert_allclose(values.std(axis=0, ddof=1) / size, 1.0, atol=0.28)
    # And a correlation to 0.13.
    found, said = np.corrcoef(values.T), stated / np.outer(size, size)
    np.testing.assert_allclose(found, said, atol=0.45)
    truth = find_true_values(model)
    for index, name in enumerate(MAIN):
        error = (values[:, index] - truth[name]) / size[index]
        assert abs(error.mean()) < 4 / np.sqrt(60)
    assert np.mean([run.chi_square for run in runs]) == pytest.approx(1.0, abs=0.1)


def test_each_hit_gets_its_own_values():
    model = find_truth(SAMPLE)
    factors = np.array([0.995, 0.998, 1.0, 1.002, 1.005])
    hits = [
        strike(
            replace(model, contact_time=factor * model.contact_time, peak_force=100.0 / factor),
            start=START + 3e-6 * factor,
        )
        for factor in factors
    ]
    found = identify_model(average_hits(hits), PAPER_SETUP, SAMPLE)
    tau = found.hit_values[:, NAMES.index("tau_p")]
    # One linear step: the square of what the hits differ.
    np.testing.assert_allclose(tau, factors * model.contact_time, rtol=1e-4)
    np.testing.assert_allclose(found.hit_values[:, NAMES.index("F0")], 100.0 / factors, rtol=1e-3)
    np.testing.assert_allclose(found.hit_values.mean(axis=0)[:6], found.values[:6], rtol=1e-6)


def test_what_the_model_does_not_describe_has_no_parameters():
    mean = strike_mean(find_truth(SAMPLE), 1e-3, 4)
    time = np.arange(mean.traces.shape[1]) / RATE
    ringing = 30.0 * np.sin(2 * np.pi * 25e3 * time)
    disturbed = replace(mean, traces=mean.traces + np.stack([np.zeros_like(ringing), ringing]))
    fitted = fit_model(disturbed, PAPER_SETUP, SAMPLE)
    assert re.search(r"it leaves .* % of the sample's peak, where", str(fitted.notes[0]))
    body = (fitted.contact_time, fitted.stiffness, fitted.damping_coefficient)
    assert not any(quantity.is_known for quantity in body)
    assert fitted.parameters == ()
    # Gains and masses are right, which such traces still tell.
    assert fitted.force_balance == pytest.approx(1.0, abs=0.05)


def test_traces_that_say_nothing_are_named():
    mean = strike_mean(find_truth(SAMPLE))
    flat, no_numbers = mean.traces.copy(), mean.traces.copy()
    flat[1], no_numbers[1] = 0.0, np.nan
    for traces, error, words in (
        (mean.traces[:1], NotDeterminedError, "the sample's trace was not measured"),
        (flat, NotDeterminedError, "a trace is flat or has points that are no"),
        (no_numbers, NotDeterminedError, "a trace is flat or has points that are no"),
        (mean.traces[:, 800:], SignalError, "cut off"),
    ):
        with pytest.raises(error, match=words):
            identify_model(make_plain_mean(traces, RATE, mean.origin, 1.0), PAPER_SETUP, SAMPLE)


def test_a_rigid_sample_does_not_tell_its_stiffness():
    # Its quasi-static response is F''/k: the mass has no say, and the gain divides.
    model = find_truth(SAMPLE)
    hard = replace(model, specimen=Body(model.specimen.mass, 2e10, 1.2e5))
    found = identify_model(strike_mean(hard, 0.25, 1), PAPER_SETUP, SAMPLE)
    assert {"k2", "sample gain"} <= set(found.undetermined)


def test_through_sensors_that_are_described_the_model_is_found_as_without():
    model = find_truth(SAMPLE)
    sensors = tuple(
        Sensor(channel, resonance=30e3, resonance_damping=0.05, low_corner=20.0)
        for channel in CHANNELS
    )
    first = -START - (FINE // 2) / FINE / RATE
    bodies = simulate_impact(
        model, FINE * RATE, FINE * COUNT, start=first, variant=ModelVariant.DRIVEN
    )
    time = np.arange(FINE * COUNT) / (FINE * RATE)
    # Another way than the filters under test: a simulation of the whole transfer function.
    natural, corner = 2.0 * np.pi * 30e3, 2.0 * np.pi * 20.0
    poles = np.convolve([1.0, 2.0 * 0.05 * natural, natural**2], [1.0, corner])
    shown = np.stack([lsim(([natural**2, 0.0], poles), body, time)[1] for body in bodies])
    traces = shown.reshape(2, COUNT, FINE).mean(axis=2)
    record = make_record(*traces, pulse_index=round(START * RATE), full_scale=0.0, rate=RATE)
    judged = judge_hit(record, PAPER_SETUP.analysis, [SensorResponse(low_corner=20.0)] * 2)
    mean = average_hits([judged.filtered])
    found = identify_model(mean, replace(PAPER_SETUP, sensors=sensors), SAMPLE)
    check_found(found, model, 2e-3)
    assert "does not describe both traces" in identify_model(mean, PAPER_SETUP, SAMPLE).misfit
