"""How the model's traces change with its parameters, by one batch of forward differences."""

from dataclasses import dataclass, replace

import numpy as np

from impact_rig.core.model.impact import (
    FULL_TURN,
    Body,
    ImpactModel,
    ModelVariant,
    simulate_impacts,
)
from impact_rig.core.signals.record import FloatArray

DRIVEN_PARAMETERS = ("tau_p", "t0", "k2", "c2", "F0")
PRINTED_PARAMETERS = ("tau_p", "t0", "k2", "c2", "F0", "k1", "c1")
RELATIVE_STEP = 2.0**-25
"""Step over a parameter's scale [-]: there half the second derivative, which a forward difference
leaves out, and the traces' rounding of some 1e-15, which it divides, are both some 3e-8."""


@dataclass(frozen=True)
class Sensitivities:
    """Accelerations of both bodies and their derivatives.

    Attributes
    ----------
    names : tuple of str
        Parameters: contact time tau_p [s], start of the contact t0 [s], k2 [N/m], c2 [N s/m],
        F0 [N]; for the printed model also k1 [N/m] and c1 [N s/m].
    traces : ndarray, shape (2, n)
        x1'' and x2'' [m/s^2].
    derivatives : ndarray, shape (2, parameters, n)
        Of the traces [m/s^2 per unit of the parameter]. For t0: the contact moves later.
    """

    names: tuple[str, ...]
    traces: FloatArray
    derivatives: FloatArray


def list_parameters(variant: ModelVariant) -> tuple[str, ...]:
    """Return the parameters of a model variant, in the order of the derivatives."""
    return DRIVEN_PARAMETERS if variant is ModelVariant.DRIVEN else PRINTED_PARAMETERS


def compute_sensitivities(
    model: ImpactModel,
    sampling_rate: float,
    count: int,
    *,
    start: float = 0.0,
    variant: ModelVariant = ModelVariant.DRIVEN,
) -> Sensitivities:
    """Compute both accelerations on a uniform time grid and their derivatives.

    The arguments are those of `simulate_impact`, and the traces are equal to its with
    `places_steps`.
    """
    names = list_parameters(variant)
    models, starts, steps = [model], [start], []
    for name in names:
        moved, moved_start, step = _move(model, start, name)
        models.append(moved)
        starts.append(moved_start)
        steps.append(step)
    traces = simulate_impacts(
        models,
        sampling_rate,
        count,
        start=np.array(starts),
        variant=variant,
        places_steps=True,
    )
    # In place: nothing of that size is allocated again.
    derivatives = traces[1:]
    derivatives -= traces[0]
    derivatives *= 1.0 / np.array(steps)[:, np.newaxis, np.newaxis]
    return Sensitivities(names, traces[0], derivatives.swapaxes(0, 1))


def _move(model: ImpactModel, start: float, name: str) -> tuple[ImpactModel, float, float]:
    """Return model and start of the grid with one parameter a step larger, and that step."""
    rate = FULL_TURN / model.contact_time
    if name == "F0":
        # The traces are linear in it, so that any step is as good.
        moved = replace(model, peak_force=model.peak_force + (abs(model.peak_force) or 1.0))
        return moved, start, moved.peak_force - model.peak_force
    if name == "t0":
        earlier = start - RELATIVE_STEP / rate
        return model, earlier, start - earlier
    if name == "tau_p":
        moved = replace(model, contact_time=model.contact_time + RELATIVE_STEP / rate)
        return moved, start, moved.contact_time - model.contact_time
    part = "hammer" if name[1] == "1" else "specimen"
    body: Body = getattr(model, part)
    if name[0] == "k":
        scale = body.stiffness + body.mass * rate**2
        changed = replace(body, stiffness=body.stiffness + RELATIVE_STEP * scale)
        step = changed.stiffness - body.stiffness
    else:
        scale = body.damping_coefficient + body.mass * rate
        changed = replace(
            body, damping_coefficient=body.damping_coefficient + RELATIVE_STEP * scale
        )
        step = changed.damping_coefficient - body.damping_coefficient
    moved = (
        replace(model, hammer=changed) if part == "hammer" else replace(model, specimen=changed)
    )
    return moved, start, step
