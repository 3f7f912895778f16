"""How long one identification takes, beside the same fit around a numerical integrator."""

import math
from collections.abc import Iterator

import numpy as np
from scipy.integrate import solve_ivp

from bench.measure import Bench, Figure, at_least, at_most, compare_times, divide, part
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.identification.fitting import FitProblem, compute_raw_noise, find_best_fit
from impact_rig.core.identification.identification import identify_model
from impact_rig.core.identification.measured_model import MeasuredModel
from impact_rig.core.identification.starting_values import StartingValues
from impact_rig.core.model.impact import ModelVariant
from impact_rig.core.session import Session
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.signals.filtering import low_pass
from impact_rig.core.signals.record import FloatArray, HitLabel
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings

SAMPLE = "steel medium"
CALLS = 20
"""Of the identification in one turn [-], our choice: as long as one fit around the integrator."""
LONGEST_IDENTIFICATION = 60.0
"""Of two traces of 5000 points [ms], as asked for."""
LEAST_GAIN = 50.0
"""Over the same fit around an integrator [-], as asked for."""
INTEGRATOR_TOLERANCE = 1e-10
"""Relative [-], our choice: the derivatives are differences of the integrator's results."""
DIFFERENCE_STEP = 1e-6
"""Of a parameter [-], our choice: the integrator's error is a ten thousandth of the difference."""
COMPARED = ("tau_p", "k2", "c2")


@part("identification", "An identification, beside the same fit around an integrator", 6.0)
def measure_identification(bench: Bench) -> Iterator[Figure]:
    """Time both fits of one hit, which end at the same place."""
    mean = strike_once()
    ours, theirs = compare_times(
        lambda: identify_model(mean, PAPER_SETUP, SAMPLE),
        lambda: fit_by_integration(mean),
        bench.extent.repeats,
        (CALLS, 1),
    )
    note = f"two traces of {mean.traces.shape[1]} points"
    times = (1e3 * time for time in ours)
    yield Figure("one identification", times, "ms", at_most(LONGEST_IDENTIFICATION), note)
    note = "the same search around DOP853, to the same minimum"
    yield Figure("times faster", divide(theirs, ours), "", at_least(LEAST_GAIN), note)


def strike_once() -> MeanHit:
    """Return one hit on the plant `dynamics`."""
    session = Session(PAPER_SETUP)
    rig = VirtualRig(PAPER_SETUP, VirtualRigSettings(plant=Plant.DYNAMICS))
    for block in rig.strike(HitLabel(SAMPLE)).split(rig.settings.digitizer.count, 0):
        session.feed(block)
    mean = session.compute_mean(SAMPLE)
    assert mean is not None
    return mean


def fit_by_integration(mean: MeanHit) -> FloatArray:
    """Run the same search on the same problem around the integrator; returns tau_p, k2, c2."""
    setup = PAPER_SETUP
    measured = IntegratedModel(
        variant=ModelVariant.DRIVEN,
        hammer_mass=setup.hammer_mass,
        moving_mass=setup.samples.get_moving_mass(SAMPLE),
        impact_speed=setup.impact_speed,
        sampling_rate=mean.sampling_rate,
        count=mean.traces.shape[1],
        cutoff_frequency=setup.analysis.cutoff_frequency,
    )
    problem = FitProblem(mean.traces, compute_raw_noise(mean), measured)
    found = find_best_fit(problem, StartingValues())
    return found.values[[measured.names.index(name) for name in COMPARED]]


class IntegratedModel(MeasuredModel):
    """The driven model with an integrator in place of the closed form."""

    def evaluate(
        self, values: FloatArray, points: slice = slice(None)
    ) -> tuple[FloatArray, FloatArray]:
        """Compute the traces, and their derivatives as quotients of differences.

        Parameters and returned arrays as in `MeasuredModel.evaluate`.
        """
        traces = self._integrate(values)
        given = dict(zip(self.names, values.tolist(), strict=True))
        peaks = np.abs(traces).max(axis=1).tolist()
        # What may be zero has a natural size all the same.
        sizes = {**given, "t0": given["tau_p"]}
        sizes["hammer offset"], sizes["sample offset"] = peaks
        steps = DIFFERENCE_STEP * np.abs([sizes[name] for name in self.names])
        derivatives = [
            (self._integrate(values + change) - traces) / step
            for change, step in zip(np.diag(steps), steps, strict=True)
        ]
        return traces[:, points], np.stack(derivatives, axis=1)[:, :, points]

    def _integrate(self, values: FloatArray) -> FloatArray:
        """Step both bodies of the driven model through time; low-passed, shape (2, n)."""
        given = dict(zip(self.names, values.tolist(), strict=True))
        duration, force = given["tau_p"], given["F0"]
        stiffness, damping = given["k2"], given["c2"]
        masses = (self.hammer_mass, self.moving_mass)

        def contact(moment: float, state: FloatArray) -> list[float]:
            _, position, hammer_speed, speed = state
            push = force * np.sin(np.pi * moment / duration) ** 2
            restoring = damping * speed + stiffness * position
            return [hammer_speed, speed, -push / masses[0], (push - restoring) / masses[1]]

        def free(_: float, state: FloatArray) -> list[float]:
            _, position, hammer_speed, speed = state
            restoring = damping * speed + stiffness * position
            return [hammer_speed, speed, 0.0, -restoring / masses[1]]

        when = np.arange(self.count) / self.sampling_rate - given["t0"]
        length = abs(force) / stiffness
        fast = math.sqrt(stiffness / masses[1])
        smallest = INTEGRATOR_TOLERANCE * length * np.array([1.0, 1.0, fast, fast])
        traces = np.zeros((2, when.size))
        state = np.zeros(4)
        # In two parts, since an integrator does not see the end of the pulse coming.
        parts = (
            (contact, 0.0, duration),
            (free, duration, float(when[-1]) + 1.0 / self.sampling_rate),
        )
        for move, first, last in parts:
            chosen = (when >= first) & (when < last)
            solution = solve_ivp(
                move,
                (first, last),
                state,
                method="DOP853",
                t_eval=np.append(when[chosen], last),
                rtol=INTEGRATOR_TOLERANCE,
                atol=smallest,
            )
            push = force * np.sin(np.pi * when[chosen] / duration) ** 2 * (move is contact)
            _, position, _, speed = solution.y[:, :-1]
            traces[0, chosen] = -push / masses[0]
            traces[1, chosen] = (push - damping * speed - stiffness * position) / masses[1]
            state = solution.y[:, -1]
        gains = np.array([[self.hammer_polarity], [given["sample gain"]]])
        offsets = np.array([[given["hammer offset"]], [given["sample offset"]]])
        filtered = low_pass(gains * traces, self.cutoff_frequency, self.sampling_rate)
        return np.asarray(filtered + offsets)
