"""The bound against numerical differentiation, closed forms, and an estimator that reaches it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import curve_fit

from impact_rig.core.errors import NotDeterminedError, ParameterError
from impact_rig.core.identification.cramer_rao import (
    CramerRaoBound,
    compute_model_bound,
    compute_pulse_bound,
)
from impact_rig.core.model.impact import Body, ImpactModel, ModelVariant, simulate_impact

RATE = 2.5e6
COUNT = 3000
START = 0.2e-3
TAU = 203.2e-6
MODEL = ImpactModel(Body(0.1, 22.54e6, 1900.0), Body(0.17, 45.29e6, 1170.0), TAU, 0.08, 100.0)
NOISE = (1.0, 0.7)


def make_pulse(
    time: np.ndarray, duration: float, start: float, peak: float, offset: float
) -> np.ndarray:
    phase = (time - start) / duration
    inside = (phase > 0) & (phase < 1)
    return offset + np.where(inside, peak * np.sin(np.pi * phase) ** 2, 0.0)


def test_equals_the_inverse_of_a_numerical_fisher_matrix() -> None:
    truth = {
        "tau_p": TAU, "t0": START, "k2": 45.29e6, "c2": 1170.0, "F0": 100.0, "sample gain": 1.0,
        "hammer offset": 0.0, "sample offset": 0.0,
    }  # fmt: skip

    def simulate(values: dict[str, float]) -> np.ndarray:
        body = Body(0.17, values["k2"], values["c2"])
        model = replace(
            MODEL, contact_time=values["tau_p"], specimen=body, peak_force=values["F0"]
        )
        traces = simulate_impact(
            model, RATE, COUNT, start=-values["t0"], variant=ModelVariant.DRIVEN
        )
        return np.concatenate(
            [
                (traces[0] + values["hammer offset"]) / NOISE[0],
                (values["sample gain"] * traces[1] + values["sample offset"]) / NOISE[1],
            ]
        )

    columns = []
    for name, value in truth.items():
        step = 1e-5 * (value or 1.0)
        up, down = (simulate({**truth, name: value + s * step}) for s in (1, -1))
        columns.append((up - down) / (2 * step))
    derivatives = np.stack(columns, axis=1)
    lengths = np.linalg.norm(derivatives, axis=0)
    scaled = derivatives / lengths
    expected = np.linalg.inv(scaled.T @ scaled) / np.outer(lengths, lengths)
    bound = compute_model_bound(MODEL, RATE, COUNT, START, NOISE)
    assert bound.names == tuple(truth)
    sizes = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        bound.covariance / np.outer(sizes, sizes), expected / np.outer(sizes, sizes), atol=1e-4
    )
    assert bound.compute_standard_deviation("k2") == pytest.approx(sizes[2], rel=1e-4)


@given(factor=st.floats(0.01, 100.0), variant=st.sampled_from(ModelVariant))
@settings(max_examples=10, deadline=None)
def test_grows_with_the_noise(factor: float, variant: ModelVariant) -> None:
    one = compute_model_bound(MODEL, RATE, COUNT, START, NOISE, variant)
    other = compute_model_bound(
        MODEL, RATE, COUNT, START, (factor * NOISE[0], factor * NOISE[1]), variant
    )
    for name in one.names:
        assert other.compute_standard_deviation(name) == pytest.approx(
            factor * one.compute_standard_deviation(name), rel=1e-5
        )


def test_falls_with_the_root_of_the_sampling_rate() -> None:
    slow = compute_model_bound(MODEL, RATE, COUNT, START, NOISE)
    fast = compute_model_bound(MODEL, 4 * RATE, 4 * COUNT, START, NOISE)
    for name in ("tau_p", "k2", "c2"):
        ratio = slow.compute_standard_deviation(name) / fast.compute_standard_deviation(name)
        assert ratio == pytest.approx(2.0, rel=2e-3)


def test_two_traces_know_the_contact_time_better_than_the_hammer_alone() -> None:
    both = compute_model_bound(MODEL, RATE, COUNT, START, NOISE)
    hammer = compute_pulse_bound(TAU, 1000.0, RATE, COUNT, START, NOISE[0])
    deaf = compute_model_bound(MODEL, RATE, COUNT, START, (NOISE[0], 1e6))
    alone = hammer.compute_standard_deviation("tau_p")
    assert both.compute_standard_deviation("tau_p") < alone
    assert deaf.compute_standard_deviation("tau_p") == pytest.approx(alone, rel=1e-4)


def test_of_the_pulse_alone_is_the_closed_form() -> None:
    # With unit height, duration and noise, N points per unit, and no offset, the integrals of the
    # products of sin^2, its slope pi sin(2 pi x) and x times that are: 3/8, pi^2/2,
    # pi^2 (1/6 - 1/(16 pi^2)), pi^2/4 and -3/16; by symmetry height and start do not mix.
    points = 4000
    square = np.pi**2 * (1 / 6 - 1 / (16 * np.pi**2))
    fisher = points * np.array(
        [[square, np.pi**2 / 4, -3 / 16 * -1], [np.pi**2 / 4, np.pi**2 / 2, 0], [3 / 16, 0, 3 / 8]]
    )
    expected = np.sqrt(np.linalg.inv(fisher)[0, 0])
    # The offset is known from a record that is much longer than the pulse.
    bound = compute_pulse_bound(1.0, 1.0, points, 200 * points, 100.0, 1.0)
    assert bound.compute_standard_deviation("tau_p") == pytest.approx(expected, rel=5e-3)


def test_least_squares_of_the_pulse_reaches_it() -> None:
    time = np.arange(1000) / RATE
    truth = (TAU, 0.1e-3, 1000.0, 0.0)
    source = np.random.default_rng(1)
    noise = 5.0
    found = []
    for _ in range(300):
        trace = make_pulse(time, *truth) + noise * source.standard_normal(time.size)
        values, _ = curve_fit(make_pulse, time, trace, p0=truth, diag=(1e4, 1e4, 1e-3, 0.1))
        found.append(values[0])
    bound = compute_pulse_bound(TAU, 1000.0, RATE, 1000, 0.1e-3, noise)
    ratio = np.std(found, ddof=1) / bound.compute_standard_deviation("tau_p")
    # 300 runs know a standard deviation to 4 %.
    assert ratio == pytest.approx(1.0, abs=0.14)


def test_what_cannot_be_known_has_no_bound() -> None:
    with pytest.raises(NotDeterminedError, match="tau_p: not determined"):
        compute_pulse_bound(TAU, 1000.0, RATE, 100, 0.1, 1.0)
    with pytest.raises(NotDeterminedError, match="not determined"):
        compute_model_bound(MODEL, RATE, 100, 1.0, NOISE)


def test_impossible_numbers_are_refused() -> None:
    with pytest.raises(ParameterError, match="sample noise is 0"):
        compute_model_bound(MODEL, RATE, COUNT, START, (1.0, 0.0))
    with pytest.raises(ParameterError, match="noise is -1"):
        compute_pulse_bound(TAU, 1.0, RATE, COUNT, START, -1.0)


def test_cannot_be_changed() -> None:
    bound = compute_pulse_bound(TAU, 1.0, RATE, COUNT, START, 1.0)
    assert isinstance(bound, CramerRaoBound)
    assert not bound.covariance.flags.writeable
