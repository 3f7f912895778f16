"""What a hit does to hammer and sample, before any sensor sees it.

`published` plays back what the paper's tables describe: on it the paper's procedure must give
back Tables 2 to 4. `dynamics` and `dynamics_printed` are the two forms of the model, with known
truth: on them the bias of an estimator is measured. `contact` are free bodies that meet by a
contact law, as metals do, which the paper's procedure reads as springs: see `contact.py`.
"""

import math
from dataclasses import dataclass

import numpy as np

from impact_rig.core.equations import (
    estimate_damping_ratio_from_coefficient,
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
    estimate_hammer_stiffness,
)
from impact_rig.core.errors import ParameterError
from impact_rig.core.model import (
    Body,
    ImpactModel,
    ModelVariant,
    compute_peak_force,
    simulate_impact,
)
from impact_rig.core.pulses import compute_pulse
from impact_rig.core.records import FloatArray
from impact_rig.core.setup import HAMMER_DAMPING_COEFFICIENT, RigSetup
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.contact import Contact

ASYMMETRY = 0.02  # of the pulse on the published plant, see `compute_pulse`


@dataclass(frozen=True)
class HitPhysics:
    """One hit as it really happens."""

    model: ImpactModel  # bodies, tau_p, v1 and F0 of this hit
    contact: Contact | None = None  # the law on the plant `contact`; None: on the others


def make_nominal_model(setup: RigSetup, sample: str) -> ImpactModel:
    """Return the true parameters of a hit on `sample`, from its reference values.

    Parameters
    ----------
    setup : RigSetup
        Masses, speed and reference values; k1 follows from the control sample's reference.
    sample : str
        Name of the sample.

    Raises
    ------
    ParameterError
        If the sample or the control sample lacks a reference value that the virtual rig needs.
    """
    chosen = setup.samples.find(sample)
    control_name = setup.samples.control_sample
    if not control_name:
        raise ParameterError(
            "the virtual rig needs a control sample: name one in the sample set, its reference"
            " contact time gives the hammer's stiffness"
        )
    control = setup.samples.find(control_name)
    for body in (*setup.find_unknown_masses(sample), *setup.find_unknown_masses(control_name)):
        raise ParameterError(f"the virtual rig needs the mass of {body}: it is not known")
    for owner, quantity, value in (
        (control, "contact time", control.reference_contact_time),
        (chosen, "contact time", chosen.reference_contact_time),
        (chosen, "stiffness", chosen.reference_stiffness),
        (chosen, "damping coefficient", chosen.reference_damping_coefficient),
    ):
        if math.isnan(value):
            raise ParameterError(
                f"sample {owner.name!r} has no reference {quantity}, which the virtual rig needs:"
                " give it in the rig file"
            )
    hammer_stiffness = estimate_hammer_stiffness(
        estimate_equivalent_stiffness(
            estimate_equivalent_mass(
                setup.hammer_mass, setup.samples.get_moving_mass(control_name)
            ),
            control.reference_contact_time,
        )
    )
    moving_mass = setup.samples.get_moving_mass(sample)
    speed = setup.for_series(sample).impact_speed
    return ImpactModel(
        hammer=Body(setup.hammer_mass, hammer_stiffness, HAMMER_DAMPING_COEFFICIENT),
        specimen=Body(
            moving_mass, chosen.reference_stiffness, chosen.reference_damping_coefficient
        ),
        contact_time=chosen.reference_contact_time,
        impact_speed=speed,
        peak_force=compute_peak_force(
            setup.hammer_mass, moving_mass, speed, chosen.reference_contact_time
        ),
    )


def simulate_plant(
    plant: Plant, physics: HitPhysics, sampling_rate: float, count: int, start: float
) -> tuple[FloatArray, FloatArray]:
    """Compute the true accelerations of hammer and sample.

    Parameters
    ----------
    plant : Plant
        Which physics.
    physics : HitPhysics
        The hit.
    sampling_rate : float
        [Hz]
    count : int
        Number of points.
    start : float
        Time of the first point from the start of the contact [s].

    Returns
    -------
    hammer, specimen : ndarray, shape (count,)
        [m/s^2]
    """
    if physics.contact is not None:
        return physics.contact.simulate(sampling_rate, count, start)
    if plant is Plant.PUBLISHED:
        time = start + np.arange(count) / sampling_rate
        return _play_hammer(physics.model, time), _play_specimen(physics.model, time)
    variant = ModelVariant.DRIVEN if plant is Plant.DYNAMICS else ModelVariant.PRINTED
    return simulate_impact(physics.model, sampling_rate, count, start=start, variant=variant)


def _play_hammer(model: ImpactModel, time: FloatArray) -> FloatArray:
    """Return the contact pulse, then the decaying tail whose first peak is U1 e^-Delta."""
    body = model.hammer
    pulse = compute_pulse(time, model.contact_time, asymmetry=ASYMMETRY)
    peak = model.peak_force / body.mass
    decay, frequency = _compute_free_decay(body)
    if frequency == 0.0:
        return peak * pulse
    late = np.maximum(time - model.contact_time, 0.0)
    top = math.atan2(frequency, decay) / frequency
    height = math.exp(-decay * top) * math.sin(frequency * top)
    second = math.exp(-decay * 2.0 * math.pi / frequency)
    tail = second / height * np.exp(-decay * late) * np.sin(frequency * late)
    return np.asarray(peak * (pulse + tail))


def _play_specimen(model: ImpactModel, time: FloatArray) -> FloatArray:
    """Return the rising half of the pulse, then the free decay from rest at its peak."""
    body = model.specimen
    rise_time = model.contact_time * (1.0 + ASYMMETRY) / 2.0
    rise = compute_pulse(time, model.contact_time, asymmetry=ASYMMETRY)
    late = np.maximum(time - rise_time, 0.0)
    peak = model.peak_force / body.mass
    return np.asarray(peak * np.where(time < rise_time, rise, _decay_from_rest(body, late)))


def _compute_free_decay(body: Body) -> tuple[float, float]:
    """Return decay rate and damped angular frequency [1/s]; frequency 0: not under-damped."""
    natural = math.sqrt(body.stiffness / body.mass)
    ratio = estimate_damping_ratio_from_coefficient(
        body.damping_coefficient, body.stiffness, body.mass
    )
    return ratio * natural, natural * math.sqrt(max(1.0 - ratio**2, 0.0))


def _decay_from_rest(body: Body, time: FloatArray) -> FloatArray:
    decay, frequency = _compute_free_decay(body)
    if frequency > 0.0:
        wave: FloatArray = np.cos(frequency * time) + decay / frequency * np.sin(frequency * time)
        return np.asarray(np.exp(-decay * time) * wave)
    spread = math.sqrt(max(decay**2 - body.stiffness / body.mass, 0.0))
    if spread == 0.0:
        return np.asarray((1.0 + decay * time) * np.exp(-decay * time))
    slow, fast = decay - spread, decay + spread
    return np.asarray((fast * np.exp(-slow * time) - slow * np.exp(-fast * time)) / (fast - slow))
