"""The derivatives against central differences of fourth order and against a finer time grid."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from impact_rig.core.filtering import low_pass
from impact_rig.core.model import (
    ImpactModel,
    ModelVariant,
    compute_sensitivities,
    list_parameters,
    simulate_impact,
)

from .test_model import make_model

RATE = 2.5e6
COUNT = 2500
START = -1e-4 - 0.37 / RATE
"""Between two points, as it always is."""
FORWARD_ERROR = 2e-6
"""Of a forward difference, over the largest derivative [-]: half a step, 3e-8 of a scale, times
second derivatives; in points a step in time is some 2e-6."""


def change(model: ImpactModel, start: float, name: str, by: float) -> tuple[ImpactModel, float]:
    """Change one parameter, whatever part of the model it belongs to."""
    if name == "t0":
        return model, start - by
    if name == "tau_p":
        return replace(model, contact_time=model.contact_time + by), start
    if name == "F0":
        return replace(model, peak_force=model.peak_force + by), start
    part = {"1": "hammer", "2": "specimen"}[name[1]]
    quantity = {"k": "stiffness", "c": "damping_coefficient"}[name[0]]
    body = getattr(model, part)
    body = replace(body, **{quantity: getattr(body, quantity) + by})
    return replace(model, **{part: body}), start


def find_size(model: ImpactModel, name: str) -> float:
    return {
        "tau_p": model.contact_time,
        "t0": model.contact_time,
        "F0": model.peak_force,
        "k1": model.hammer.stiffness,
        "c1": 2000.0,
        "k2": model.specimen.stiffness,
        "c2": 2000.0,
    }[name]


def differentiate(
    model: ImpactModel,
    name: str,
    relative_step: float,
    simulate: Callable[[ImpactModel, float], NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Fourth-order central difference of both traces."""
    step = relative_step * find_size(model, name)
    at = [simulate(*change(model, START, name, n * step)) for n in (-2, -1, 1, 2)]
    return (at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (12 * step)


def simulate_driven(model: ImpactModel, start: float) -> NDArray[np.float64]:
    return np.stack(simulate_impact(model, RATE, COUNT, start=start, variant=ModelVariant.DRIVEN))


RATIOS = [(0.64, 0.3), (0.05, 0.02), (1.0, 1.0), (2.0, 3.0)]


@pytest.mark.parametrize("name", list_parameters(ModelVariant.DRIVEN))
@pytest.mark.parametrize(("first_ratio", "second_ratio"), RATIOS)
def test_driven_derivatives_are_those_of_the_simulation(first_ratio, second_ratio, name):
    model = make_model(first_ratio, second_ratio)
    found = compute_sensitivities(model, RATE, COUNT, start=START)
    expected = differentiate(model, name, 2e-4, simulate_driven)
    ours = found.derivatives[:, found.names.index(name)]
    # The force's second derivative jumps at both ends of the contact: the oracle's differences in
    # time are second order there only, (omega h)^2 of the peak.
    atol = 2e-5 if name in ("tau_p", "t0") else FORWARD_ERROR
    np.testing.assert_allclose(ours, expected, rtol=0, atol=atol * np.abs(expected).max())


@pytest.mark.parametrize("part", [0.0, 0.2, 0.5, 0.8])
def test_printed_steps_stand_where_they_are_between_the_points(part):
    # The oracle: sampled so finely that the place of the step does not matter, then low-passed
    # and thinned.
    model, fine, start = make_model(), 32, -1e-4 - part / RATE
    coarse = compute_sensitivities(
        model, RATE, COUNT, start=start, variant=ModelVariant.PRINTED
    ).traces
    dense = np.stack(simulate_impact(model, fine * RATE, fine * COUNT, start=start))
    ours = low_pass(coarse, 50e3, RATE)
    expected = low_pass(dense, 50e3, fine * RATE)[:, ::fine]
    naive = low_pass(np.stack(simulate_impact(model, RATE, COUNT, start=start)), 50e3, RATE)
    inner = slice(100, -100)
    peak = np.abs(expected).max()
    # Half a fine point of the oracle, and the filter's own design at two rates: 0.1 % of the peak.
    assert np.abs(ours - expected)[:, inner].max() < 1.5e-3 * peak
    if part in (0.0, 0.8):
        assert np.abs(naive - expected)[:, inner].max() > 3e-3 * peak


@pytest.mark.parametrize("name", list_parameters(ModelVariant.PRINTED))
@pytest.mark.parametrize(("first_ratio", "second_ratio"), RATIOS)
def test_printed_derivatives_are_those_of_the_printed_traces(first_ratio, second_ratio, name):
    model = make_model(first_ratio, second_ratio)

    def simulate(changed: ImpactModel, start: float) -> NDArray[np.float64]:
        return compute_sensitivities(
            changed, RATE, COUNT, start=start, variant=ModelVariant.PRINTED
        ).traces

    found = compute_sensitivities(model, RATE, COUNT, start=START, variant=ModelVariant.PRINTED)
    expected = differentiate(model, name, 1e-4, simulate)
    ours = found.derivatives[:, found.names.index(name)]
    np.testing.assert_allclose(ours, expected, rtol=0, atol=FORWARD_ERROR * np.abs(expected).max())
