"""The closed form of the model, beside an integrator, an exponential, and itself."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from impact_rig.bench.figures import Figure, at_least, at_most
from impact_rig.bench.integration import METHOD, SCALES, TOLERANCE, integrate_impact
from impact_rig.bench.part import Bench, Part
from impact_rig.bench.timing import compare_times, divide
from impact_rig.core.model.impact import (
    ImpactModel,
    ModelVariant,
    simulate_impact,
    simulate_impacts,
)
from impact_rig.core.model.sensitivities import compute_sensitivities
from impact_rig.core.setup.paper import HAMMER_DAMPING_COEFFICIENT, PAPER_SETUP
from impact_rig.devices.virtual.plants import find_nominal_model

SAMPLE = "steel medium"
SAMPLING_RATE = 2.5e6
"""Of the paper [Hz]."""
COUNT = 5000
"""Points of a record: 2 ms."""
BATCH = 1000
"""Records in one call [-], as asked for."""
SCATTER = 0.1
"""Largest change of each parameter in the batch, relative [-], our choice."""
CALLS = 150
"""Of what takes microseconds, in one turn [-], our choice: as long as one integration."""
LENIENT = tuple(TOLERANCE * scale for scale in SCALES)
"""Absolute tolerances of an integrator that is told how large the states are [m, m/s]."""
SMALLEST_GAIN = 150.0
LARGEST_DIFFERENCE = 1e-9
LARGEST_COST = 3.0
SMALLEST_BATCH_GAIN = 2.0
"""Over the integrator, of the peak, in exponentials and over single calls [-], as asked for."""


def measure(bench: Bench) -> tuple[Figure, ...]:
    """Time one record and many, with both ways to drive the bodies."""
    figures: list[Figure] = []
    variants = tuple(ModelVariant)
    for number, variant in enumerate(variants):
        bench.report(number, len(variants))
        figures += _measure_one(bench.extent.repeats, variant)
        figures.append(_measure_many(bench.extent.repeats, variant, bench.extent.seed))
    return tuple(figures)


def _measure_one(repeats: int, variant: ModelVariant) -> list[Figure]:
    """Compare one record with the integrator, an exponential and its own sensitivities."""
    model = find_nominal_model(PAPER_SETUP, SAMPLE, HAMMER_DAMPING_COEFFICIENT)
    times = np.arange(COUNT) / SAMPLING_RATE
    exponents = (-1e3 + 1e5j) * times

    def simulate() -> object:
        return simulate_impact(model, SAMPLING_RATE, COUNT, variant=variant)

    def integrate() -> object:
        return integrate_impact(model, times, variant)

    def integrate_scaled() -> object:
        return integrate_impact(model, times, variant, LENIENT)

    def differentiate() -> object:
        return compute_sensitivities(model, SAMPLING_RATE, COUNT, variant=variant)

    ours, integrator = compare_times(simulate, integrate, repeats, (CALLS, 1))
    again, scaled = compare_times(simulate, integrate_scaled, repeats, (CALLS, 1))
    beside, exponential = compare_times(simulate, lambda: np.exp(exponents), repeats, (CALLS,) * 2)
    derivatives, trace = compare_times(differentiate, simulate, repeats, (CALLS,) * 2)
    name = variant.value
    return [
        Figure(
            f"{name}, speed over that of {METHOD}",
            divide(integrator, ours),
            goal=at_least(SMALLEST_GAIN),
            note=f"{1e6 * min(ours):.0f} us at best, {METHOD} at {TOLERANCE:g}"
            f" {1e3 * min(integrator):.1f} ms",
        ),
        Figure(
            f"{name}, the same with atol by state",
            divide(scaled, again),
            note=f"{METHOD} at rtol {TOLERANCE:g} and atol {TOLERANCE:g} of each state's size",
        ),
        Figure(
            f"{name}, difference from it over the peak",
            (find_difference(model, variant),),
            goal=at_most(LARGEST_DIFFERENCE),
        ),
        Figure(
            f"{name}, time over that of a complex exp",
            divide(beside, exponential),
            goal=at_most(LARGEST_COST),
            note=f"of as many points, {1e6 * min(exponential):.0f} us at best",
        ),
        Figure(f"{name}, all sensitivities over the traces", divide(derivatives, trace)),
    ]


def find_difference(model: ImpactModel, variant: ModelVariant) -> float:
    """Return the largest difference from the integrator over the peak of the trace [-]."""
    ours = np.array(simulate_impact(model, SAMPLING_RATE, COUNT, variant=variant))
    theirs = integrate_impact(model, np.arange(COUNT) / SAMPLING_RATE, variant)
    return float(np.max(np.abs(ours - theirs).max(axis=1) / np.abs(theirs).max(axis=1)))


def _measure_many(repeats: int, variant: ModelVariant, seed: int) -> Figure:
    """Compare one call for many records with as many calls."""
    models = make_models(BATCH, seed)

    def simulate_all() -> object:
        return simulate_impacts(models, SAMPLING_RATE, COUNT, variant=variant)

    def simulate_each() -> object:
        return [simulate_impact(model, SAMPLING_RATE, COUNT, variant=variant) for model in models]

    together, single = compare_times(simulate_all, simulate_each, repeats)
    return Figure(
        f"{variant.value}, speed of {BATCH} in a batch over single calls",
        divide(single, together),
        goal=at_least(SMALLEST_BATCH_GAIN),
        note=f"{1e6 * min(together) / BATCH:.0f} us for each at best",
    )


def make_models(count: int, seed: int) -> Sequence[ImpactModel]:
    """Return models of the paper's samples, no two of them alike."""
    generator = np.random.default_rng(seed)
    names = PAPER_SETUP.samples.names
    nominal = [find_nominal_model(PAPER_SETUP, name, HAMMER_DAMPING_COEFFICIENT) for name in names]
    models = []
    for number in range(count):
        model = nominal[number % len(nominal)]
        factors = generator.uniform(1.0 - SCATTER, 1.0 + SCATTER, 3)
        specimen = replace(
            model.specimen,
            stiffness=float(factors[0] * model.specimen.stiffness),
            damping_coefficient=float(factors[1] * model.specimen.damping_coefficient),
        )
        contact_time = float(factors[2] * model.contact_time)
        models.append(replace(model, specimen=specimen, contact_time=contact_time))
    return models


PART = Part(
    "model", "The model: one record and many, beside integrator and exponential", measure, 9.0
)
