"""What a hit does to hammer and sample, before any sensor sees it.

`published` plays back what the paper's tables describe: on it the paper's procedure must give
back Tables 2 to 4. `dynamics` and `dynamics_printed` are the two forms of the model, with known
truth: on them the bias of an estimator is measured. `contact` are free bodies that meet by a
contact law, as metals do, which the paper's procedure reads as springs: see `contact.py`.

The versed-sine has a closed form in the core. For the other shapes the force is taken as linear
between the points of a fine grid over the contact, for which the answer of a linear system is
exact (first-order hold); afterwards the sample is left alone, again exact.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.signal import cont2discrete, lfilter, ss2tf

from impact_rig.core.damping.log_decrement import estimate_damping_ratio_from_coefficient
from impact_rig.core.errors import ParameterError
from impact_rig.core.model.impact import (
    Body,
    ImpactModel,
    ModelVariant,
    compute_peak_force,
    simulate_impact,
)
from impact_rig.core.model.oscillator import (
    FreeOscillator,
    compute_padding,
    simulate_free_oscillators,
)
from impact_rig.core.model.pulses import (
    VERSED_SINE,
    PulseShape,
    compute_pulse,
)
from impact_rig.core.model.stiffness import (
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
    estimate_hammer_stiffness,
)
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import FloatArray
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.contact import Contact

CONTACT_STEPS = 4096
"""Points of the grid over a contact [-]. A force F bends by pi^2 F0 / tau_p^2 at most where it is
large, so that a straight line misses it by 7e-8 of F0; what that does to the sample is less. The
kinks of the shapes, at start, top and end, are points of the grid."""


def simulate_driven(
    model: ImpactModel, shape: PulseShape, sampling_rate: float, count: int, start: float
) -> tuple[FloatArray, FloatArray]:
    """Simulate both bodies: the hammer's trace is the pulse, the sample is driven by it alone.

    Parameters
    ----------
    model : ImpactModel
        m1, F0, tau_p and the sample are used.
    shape : PulseShape
        Of the force.
    sampling_rate : float
        [Hz]
    count : int
        Number of points.
    start : float
        Time of the first point from the start of the contact [s].

    Returns
    -------
    hammer, specimen : ndarray, shape (count,)
        [m/s^2], signed as those of `simulate_impact`; within 1e-6 of the peak.
    """
    time = start + np.arange(count) / sampling_rate
    force = model.peak_force * compute_pulse(time, model.contact_time, shape)
    body = model.specimen
    matrix = np.array(
        [[0.0, 1.0], [-body.stiffness / body.mass, -body.damping_coefficient / body.mass]]
    )
    grid = np.linspace(0.0, model.contact_time, CONTACT_STEPS + 1)
    position, speed = _drive(
        matrix, model.peak_force * compute_pulse(grid, model.contact_time, shape) / body.mass, grid
    )
    record = np.zeros(count + compute_padding(count))
    specimen = record[:count]
    inside = (time >= 0.0) & (time <= model.contact_time)
    specimen[inside] = force[inside] / body.mass + matrix[1] @ np.stack(
        [position(time[inside]), speed(time[inside])]
    )
    free = int(np.searchsorted(time, model.contact_time, side="right"))
    if free < count:
        oscillator = FreeOscillator(
            stiffness=-matrix[1, 0] / sampling_rate**2,
            damping=-matrix[1, 1] / sampling_rate,
            position=float(position(model.contact_time)) * sampling_rate**2,
            speed=float(speed(model.contact_time)) * sampling_rate,
            first=(time[free] - model.contact_time) * sampling_rate,
        )
        simulate_free_oscillators([oscillator], count - free, [record[np.newaxis, free:]])
    return -force / model.hammer.mass, specimen


def _drive(
    matrix: FloatArray, drive: FloatArray, grid: FloatArray
) -> tuple[CubicHermiteSpline, CubicHermiteSpline]:
    """Return position [m] and speed [m/s] over the contact, from rest, as functions of time.

    Parameters
    ----------
    matrix : ndarray, shape (2, 2)
        Of the state (x, x') [1/s].
    drive : ndarray, shape (n,)
        Force over mass on the grid [m/s^2].
    grid : ndarray, shape (n,)
        Uniform [s].
    """
    # In units of the contact time, so that the polynomials below are well scaled.
    length = float(grid[-1])
    scaled = np.array([[0.0, 1.0], [matrix[1, 0] * length**2, matrix[1, 1] * length]])
    step = 1.0 / (grid.size - 1)
    discrete = cont2discrete(
        (scaled, np.array([[0.0], [1.0]]), np.eye(2), np.zeros((2, 1))), step, method="foh"
    )
    numerators, denominator = ss2tf(*discrete[:4])
    position, speed = (lfilter(row, denominator, drive * length**2) for row in numerators)
    speed = speed / length
    acceleration = drive + matrix[1, 0] * position + matrix[1, 1] * speed
    return (
        CubicHermiteSpline(grid, position, speed),
        CubicHermiteSpline(grid, speed, acceleration),
    )


@dataclass(frozen=True)
class HitPhysics:
    """One hit as it really happens.

    Attributes
    ----------
    model : ImpactModel
        Bodies, tau_p, v1 and F0 of this hit.
    shape : PulseShape
        Of the contact force.
    asymmetry : float
        Of the contact force on the published plant, see `compute_pulse` [-]; the model's force
        is symmetric.
    contact : Contact or None
        The bodies and their law on the plant `contact`, where the model only says how long and
        how hard; None: on the others.
    """

    model: ImpactModel
    shape: PulseShape = VERSED_SINE
    asymmetry: float = 0.0
    contact: Contact | None = None


def check_pulse_shape(plant: Plant, shape: PulseShape) -> None:
    """Raise `ParameterError` if a plant cannot have that shape of the contact force."""
    if shape is VERSED_SINE:
        return
    if plant is Plant.DYNAMICS_PRINTED:
        raise ParameterError(
            f"pulse shape {shape.name!r} is not for the plant {plant.value}, whose printed"
            f" equation (4) is the {VERSED_SINE.name}: choose {Plant.DYNAMICS.value}"
        )
    if plant is Plant.CONTACT:
        raise ParameterError(
            f"pulse shape {shape.name!r} is not for the plant {plant.value}, whose contact law"
            " makes the pulse: give a contact_exponent"
        )


def make_nominal_model(setup: RigSetup, sample: str, hammer_damping: float) -> ImpactModel:
    """Return the true parameters of a hit on `sample`, from its reference values.

    Parameters
    ----------
    setup : RigSetup
        Masses, speed and reference values; k1 follows from the control sample's reference.
    sample : str
        Name of the sample.
    hammer_damping : float
        c1 [N s/m].

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
                f"sample {owner.name!r} has no reference {quantity}: the virtual rig cannot"
                " strike it without; give one in the rig file"
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
        hammer=Body(setup.hammer_mass, hammer_stiffness, hammer_damping),
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
        return _play_hammer(physics, time), _play_specimen(physics, time)
    if physics.shape is not VERSED_SINE:
        return simulate_driven(physics.model, physics.shape, sampling_rate, count, start)
    variant = ModelVariant.DRIVEN if plant is Plant.DYNAMICS else ModelVariant.PRINTED
    return simulate_impact(physics.model, sampling_rate, count, start=start, variant=variant)


def _play_hammer(physics: HitPhysics, time: FloatArray) -> FloatArray:
    """Return the contact pulse, then the decaying tail whose first peak is U1 e^-Delta."""
    model, body = physics.model, physics.model.hammer
    pulse = compute_pulse(time, model.contact_time, physics.shape, physics.asymmetry)
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


def _play_specimen(physics: HitPhysics, time: FloatArray) -> FloatArray:
    """Return the rising half of the pulse, then the free decay from rest at its peak."""
    model, body = physics.model, physics.model.specimen
    rise_time = model.contact_time * (1.0 + physics.asymmetry) / 2.0
    rise = compute_pulse(time, model.contact_time, physics.shape, physics.asymmetry)
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
