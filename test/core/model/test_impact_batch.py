"""Many impacts in one call, and bodies far from any metal, against extended precision."""

import time as clock
from collections.abc import Callable

import numpy as np
import pytest

from impact_rig.core.errors import ParameterError
from impact_rig.core.model.impact import (
    BATCH,
    Body,
    ImpactModel,
    ModelVariant,
    simulate_impact,
    simulate_impacts,
)
from impact_rig.core.model.sensitivities import compute_sensitivities, find_parameter_names

RATE = 2.5e6
COUNT = 5000
EXACT = np.longdouble
TURN = 8 * np.arctan(EXACT(1))


def make_model(seed: int) -> ImpactModel:
    """Draw bodies, from soft to hard and from hardly to strongly damped, critical included."""
    draw = np.random.default_rng(seed)
    tau = 10 ** draw.uniform(-4.5, -3.2)
    bodies = []
    for ratio in (1.0, 1.0) if seed % 5 == 0 else 10 ** draw.uniform(-3.0, 1.0, 2):
        mass, frequency = 10 ** draw.uniform(-2, 0), np.pi / tau * 10 ** draw.uniform(-1.5, 1.5)
        bodies.append(Body(mass, mass * frequency**2, 2.0 * ratio * mass * frequency))
    return ImpactModel(bodies[0], bodies[1], tau, draw.normal(), 60.0 * draw.normal())


MODELS = [make_model(seed) for seed in range(BATCH + 6)]


@pytest.mark.parametrize("variant", ModelVariant)
def test_many_impacts_in_one_call_are_those_of_single_calls(variant: ModelVariant) -> None:
    starts = np.random.default_rng(1).uniform(-2e-4, 4e-4, len(MODELS))
    found = simulate_impacts(MODELS, RATE, 700, start=starts, variant=variant)
    assert found.shape == (len(MODELS), 2, 700)
    for traces, model, start in zip(found, MODELS, starts.tolist(), strict=True):
        one = np.stack(simulate_impact(model, RATE, 700, start=start, variant=variant))
        np.testing.assert_allclose(traces, one, rtol=0, atol=1e-11 * np.abs(one).max())


def test_one_start_stands_for_all() -> None:
    few = MODELS[:3]
    found = simulate_impacts(few, RATE, 400, start=-1e-5)
    each = simulate_impacts(few, RATE, 400, start=np.full(3, -1e-5))
    np.testing.assert_array_equal(found, each)


def test_no_impact_and_no_point_are_no_special_case() -> None:
    assert simulate_impacts([], RATE, 10).shape == (0, 2, 10)
    assert simulate_impacts(MODELS[:2], RATE, 0).shape == (2, 2, 0)


@pytest.mark.parametrize("variant", ModelVariant)
def test_a_record_that_ends_before_the_contact_is_zero(variant: ModelVariant) -> None:
    # Beside one that begins long after it.
    found = simulate_impacts(MODELS[:2], RATE, 100, start=np.array([-1.0, 1.0]), variant=variant)
    assert not found[0].any()
    assert np.isfinite(found).all()


def exponentiate(matrix: np.ndarray) -> np.ndarray:
    """Sum the series of e^A - 1 in extended precision, scaled and squared."""
    squarings = max(0, int(np.ceil(np.log2(float(np.abs(matrix).sum(axis=0).max()) + 1e-9))) + 3)
    scaled = matrix / EXACT(2) ** squarings
    result, term = scaled.copy(), scaled.copy()
    for n in range(2, 20):
        term = term.dot(scaled) / n
        result = result + term
    for _ in range(squarings):
        result = result.dot(result) + 2 * result
    return result + np.eye(len(matrix), dtype=EXACT)


def expect(model: ImpactModel, times: list[float], variant: ModelVariant) -> np.ndarray:
    """Return both accelerations, shape (2, times), from states in extended precision."""
    m1, k1, c1, m2, k2, c2, tau, v1, peak = (
        EXACT(value)
        for value in (
            *(model.hammer.mass, model.hammer.stiffness, model.hammer.damping_coefficient),
            *(model.specimen.mass, model.specimen.stiffness, model.specimen.damping_coefficient),
            *(model.contact_time, model.impact_speed, model.peak_force),
        )
    )
    sign = EXACT(-1)
    if variant is ModelVariant.DRIVEN:
        k1, c1, v1, sign = EXACT(0), EXACT(0), EXACT(0), EXACT(1)
    matrix = np.zeros((7, 7), dtype=EXACT)
    matrix[0, 2] = matrix[1, 3] = 1
    matrix[2, :4] = [-k1 / m1, k1 / m1, -c1 / m1, c1 / m1]
    matrix[3, :4] = [k1 / m2, (-k1 - k2) / m2, c1 / m2, (-c1 - c2) / m2]
    matrix[3, 4], matrix[3, 5] = sign / m2, -sign / m2
    if variant is ModelVariant.DRIVEN:
        matrix[2, 4], matrix[2, 5] = -1 / m1, 1 / m1
    matrix[5, 6], matrix[6, 5] = -TURN / tau, TURN / tau
    start = np.array([0, 0, v1, 0, peak / 2, peak / 2, 0], dtype=EXACT)
    free = matrix.copy()
    free[2, :], free[3, :] = 0, 0
    free[2, [0, 2]], free[3, [1, 3]] = (-k1 / m1, -c1 / m1), (-k2 / m2, -c2 / m2)
    end = exponentiate(matrix * tau).dot(start)
    columns = []
    for time in times:
        if time < 0.0:
            columns.append(np.zeros(2))
        elif time <= model.contact_time:
            columns.append((matrix.dot(exponentiate(matrix * EXACT(time)).dot(start)))[2:4])
        else:
            late = EXACT(time) - tau
            columns.append((free.dot(exponentiate(free * late).dot(end)))[2:4])
    return np.array(columns, dtype=np.float64).T


@pytest.mark.skipif(np.finfo(EXACT).eps > 1e-18, reason="no extended precision on this machine")
@pytest.mark.parametrize("variant", ModelVariant)
@pytest.mark.parametrize("seed", range(10))
def test_extreme_bodies_agree_with_extended_precision(seed: int, variant: ModelVariant) -> None:
    model = MODELS[seed]
    start = -0.3 * model.contact_time
    found = np.stack(simulate_impact(model, RATE, COUNT, start=start, variant=variant))
    contact = int(model.contact_time * RATE)
    points = [
        *range(0, 2 * contact, max(contact // 6, 1)),
        *np.abs(found).argmax(axis=1).tolist(),
        COUNT - 1,
    ]
    expected = expect(model, [start + n / RATE for n in points], variant)
    for ours, theirs, whole in zip(found[:, points], expected, found, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9 * np.abs(whole).max())


@pytest.mark.parametrize("start", [float("nan"), float("inf")])
def test_a_time_grid_that_begins_nowhere_is_refused(start: float) -> None:
    with pytest.raises(ParameterError, match=r"start of a time grid .* finite"):
        simulate_impact(MODELS[0], RATE, 10, start=start)


def test_fewer_points_than_none_are_refused() -> None:
    with pytest.raises(ParameterError, match="count is -1 points: it must be 0 or more"):
        simulate_impacts(MODELS[:1], RATE, -1)


METAL = ImpactModel(Body(0.1, 22.54e6, 1900.0), Body(0.17, 45.29e6, 1700.0), 203.2e-6, 0.08, 60)


def find_lowest_costs(*calls: Callable[[], object], turns: int) -> list[float]:
    """Time calls by turns; of each the best, since what else the machine does is not theirs."""
    costs = []
    for _ in range(turns):
        for call in calls:
            start = clock.process_time()
            call()
            costs.append(clock.process_time() - start)
    return [min(costs[index :: len(calls)]) for index in range(len(calls))]


@pytest.mark.parametrize("variant", ModelVariant)
def test_a_record_of_both_bodies_costs_no_more_than_three_exponentials(
    variant: ModelVariant,
) -> None:
    numbers = np.linspace(0.0, 1.0, COUNT) * (-1.0 + 30.0j)
    ours, limit = find_lowest_costs(
        lambda: simulate_impact(METAL, RATE, COUNT, variant=variant),
        lambda: np.exp(numbers),
        turns=60,
    )
    assert ours <= 3.0 * limit


@pytest.mark.parametrize("variant", ModelVariant)
def test_many_impacts_cost_less_than_half_of_single_calls(variant: ModelVariant) -> None:
    models = [METAL] * BATCH
    together, singly = find_lowest_costs(
        lambda: simulate_impacts(models, RATE, COUNT, variant=variant),
        lambda: [simulate_impact(model, RATE, COUNT, variant=variant) for model in models],
        turns=8,
    )
    assert together <= 0.5 * singly


@pytest.mark.parametrize("variant", ModelVariant)
def test_all_derivatives_cost_less_than_as_many_simulations(variant: ModelVariant) -> None:
    names = find_parameter_names(variant)
    derivatives, differences = find_lowest_costs(
        lambda: compute_sensitivities(METAL, RATE, COUNT, variant=variant),
        lambda: [simulate_impact(METAL, RATE, COUNT, variant=variant) for _ in names],
        turns=30,
    )
    assert derivatives <= differences
