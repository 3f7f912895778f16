"""Motion of hammer and sample in a hit, before the sensors.

`published` is what the paper's tables describe: on it the paper's procedure gives back Tables 2 to
4, and the model with their numbers lies on the traces. `dynamics` and `dynamics_printed` are the
two forms of the model, with known truth: on them the bias of an estimator is measured. `contact`
are free bodies that meet by a contact law, as metals do, which the paper's procedure reads as
springs: see `contact.py`.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy

from impact_rig.core.estimates.damping import estimate_log_decrement
from impact_rig.core.estimates.equations import (
    estimate_damping_ratio_from_coefficient,
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
    estimate_hammer_stiffness,
)
from impact_rig.core.estimates.model import (
    Body,
    ImpactModel,
    ModelVariant,
    compute_peak_force,
    simulate_impact,
)
from impact_rig.core.given.errors import NotDeterminedError, ParameterError
from impact_rig.core.given.records import FloatArray
from impact_rig.core.given.setup import HAMMER_DAMPING_COEFFICIENT, RigSetup
from impact_rig.core.hit.pulses import compute_pulse
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


STEPS = 1000
"""Points in a contact, on which the log decrement is read [-]: its peaks are within 1e-5."""


def make_published_model(setup: RigSetup, sample: str) -> ImpactModel:
    """Return the same, with the damping c2 on which the log decrement reads the reference value.

    The largest peak lies within the contact, which still drives the body: the log decrement reads
    c2 some 5 to 16 % too low on the paper's samples. A c2 that leaves no second peak stays as it
    is.

    Raises
    ------
    ParameterError
        As `make_nominal_model`.
    """
    model = make_nominal_model(setup, sample)
    body = model.specimen
    decay, frequency = _compute_free_decay(body)
    if not frequency:
        return model
    wanted = 2.0 * math.pi * decay / frequency

    def damp(factor: float) -> ImpactModel:
        damping = factor * body.damping_coefficient
        return replace(model, specimen=replace(body, damping_coefficient=damping))

    def read(factor: float) -> float:
        """Return how much more than wanted the log decrement is [-]."""
        rate = STEPS / model.contact_time
        count = STEPS + math.ceil(4.0 * math.pi / frequency * rate)
        trace = simulate_impact(damp(factor), rate, count, variant=ModelVariant.DRIVEN)[1]
        try:
            return estimate_log_decrement(trace, 0.0).log_decrement - wanted
        except NotDeterminedError:
            return math.inf

    if not read(0.5) < 0.0 < read(2.0) < math.inf:
        return model
    return damp(float(scipy.optimize.brentq(read, 0.5, 2.0, xtol=1e-6)))


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
    is_printed = plant is Plant.DYNAMICS_PRINTED
    variant = ModelVariant.PRINTED if is_printed else ModelVariant.DRIVEN
    traces = simulate_impact(physics.model, sampling_rate, count, start=start, variant=variant)
    if plant is Plant.PUBLISHED:
        time = start + np.arange(count) / sampling_rate
        return _play_hammer(physics.model, time), traces[1]
    return traces


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


def _compute_free_decay(body: Body) -> tuple[float, float]:
    """Return decay rate and damped angular frequency [1/s]; frequency 0: not under-damped."""
    natural = math.sqrt(body.stiffness / body.mass)
    ratio = estimate_damping_ratio_from_coefficient(
        body.damping_coefficient, body.stiffness, body.mass
    )
    return ratio * natural, natural * math.sqrt(max(1.0 - ratio**2, 0.0))
