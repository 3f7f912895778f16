"""The closed form of the model beside an integrator; a contact law."""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp

from bench.measure import Bench, Figure, compare_times, divide
from impact_rig.core.estimates.contact_law import look_at_law
from impact_rig.core.estimates.model import ImpactModel, ModelVariant, simulate_impact
from impact_rig.core.given.records import FloatArray, HitLabel
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.core.mean.mean_hit import MeanHit
from impact_rig.core.session import Session
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.plants import make_nominal_model
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings

SAMPLE = "steel medium"
SAMPLING_RATE = 2.5e6  # [Hz], the paper's
COUNT = 5000  # points of a record: 2 ms
CALLS = 150  # of what takes microseconds, in one turn: as long as one integration
TOLERANCE = 1e-10  # of the integrator, relative, as asked for
SMALLEST = 1e-17  # of the integrator, absolute: small enough that `TOLERANCE` alone decides


def integrate_impact(
    model: ImpactModel, times: FloatArray, variant: ModelVariant, longest_step: float = np.inf
) -> FloatArray:
    """Return the accelerations of both bodies as an integrator finds them, shape (2, n).

    In two parts, since an integrator does not see the end of the pulse coming. Between long steps
    it interpolates worse than it steps.
    """
    first, second, tau = model.hammer, model.specimen, model.contact_time
    m1, k1, c1 = first.mass, first.stiffness, first.damping_coefficient
    m2, k2, c2 = second.mass, second.stiffness, second.damping_coefficient
    is_printed = variant is ModelVariant.PRINTED

    def contact(moment: float | FloatArray, state: FloatArray) -> FloatArray:
        x1, x2, v1, v2 = state
        force = model.peak_force * np.sin(np.pi * moment / tau) ** 2
        own = c2 * v2 + k2 * x2
        if is_printed:
            between = c1 * (v1 - v2) + k1 * (x1 - x2)
            return np.array([v1, v2, -between / m1, (between - force - own) / m2])
        return np.array([v1, v2, -force / m1, (force - own) / m2])

    def free(_: float | FloatArray, state: FloatArray) -> FloatArray:
        x1, x2, v1, v2 = state
        hammer = -(c1 * v1 + k1 * x1) / m1 if is_printed else 0.0 * v1
        return np.array([v1, v2, hammer, -(c2 * v2 + k2 * x2) / m2])

    def step(motion: Callable[..., FloatArray], begin: FloatArray, when: FloatArray) -> FloatArray:
        states: FloatArray = solve_ivp(
            motion,
            (0.0 if motion is contact else tau, when[-1]),
            begin,
            method="DOP853",
            t_eval=when,
            rtol=TOLERANCE,
            atol=SMALLEST,
            max_step=longest_step,
        ).y
        return states

    during, after = times[times <= tau], times[times > tau]
    speed = model.impact_speed if is_printed else 0.0
    states = step(contact, np.array([0.0, 0.0, speed, 0.0]), np.union1d(during, tau))
    later = step(free, states[:, -1], after)
    return np.hstack([contact(during, states[:, : during.size])[2:], free(after, later)[2:]])


def measure_model(bench: Bench) -> Iterator[Figure]:
    """Time one record, with both ways to drive the bodies."""
    model = make_nominal_model(PAPER_SETUP, SAMPLE)
    times = np.arange(COUNT) / SAMPLING_RATE
    for variant in ModelVariant:

        def simulate(variant: ModelVariant = variant) -> FloatArray:
            return np.array(simulate_impact(model, SAMPLING_RATE, COUNT, variant=variant))

        def integrate(variant: ModelVariant = variant) -> FloatArray:
            return integrate_impact(model, times, variant)

        ours, theirs = compare_times(simulate, integrate, bench.extent.repeats, (CALLS, 1))
        name = f"model {variant.value}"
        yield Figure(f"{name}, speed over DOP853", divide(theirs, ours), least=150)
        peak = np.abs(integrate()).max(axis=1)
        difference = float(np.max(np.abs(simulate() - integrate()).max(axis=1) / peak))
        yield Figure(f"{name}, difference over the peak", difference, most=1e-9)


def strike(plant: Plant, hits: int) -> MeanHit:
    """Return the mean of some hits of the virtual rig."""
    session = Session(PAPER_SETUP)
    rig = VirtualRig(PAPER_SETUP, VirtualRigSettings(plant=plant))
    for number in range(1, hits + 1):
        hit = rig.strike(HitLabel(SAMPLE, record=number, impact=number))
        for block in hit.split(rig.settings.digitizer.count, 0):
            session.feed(block)
    mean = session.compute_mean(SAMPLE)
    assert mean is not None
    return mean


def measure_law(bench: Bench) -> Iterator[Figure]:
    """Time the contact law of one hit, and of the mean of ten."""
    for hits, most in ((1, 8.0), (10, 14.0)):
        mean = strike(Plant.CONTACT, hits)
        times, _ = compare_times(
            partial(look_at_law, mean, PAPER_SETUP, SAMPLE),
            lambda: None,
            bench.extent.repeats,
        )
        found = (1e3 * time for time in times)
        yield Figure(f"contact law, hits of a sample: {hits}", found, "ms", most=most)
