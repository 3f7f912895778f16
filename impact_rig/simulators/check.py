"""What the engines make of exported parameters: held against what was measured, step by step."""

import importlib.util
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from impact_rig.core.errors import ParameterError
from impact_rig.core.signals.record import FloatArray
from impact_rig.simulators.contact import Contact
from impact_rig.simulators.parameters import ENGINES, Engine, Parameters
from impact_rig.simulators.texts import SPHERE_RADIUS, format_text

STEPS = (1e-3, 1e-4, 1e-5, 5e-6, 1e-6, 5e-7, 1e-7)
"""At which engines are checked [s], our choice: from what robots are simulated with to what a
contact of metal needs."""
PHASES = (0.1, 0.5, 0.9)
"""Of a step, at which the bodies touch [-], our choice: in coarse steps much depends on it."""
LARGEST_DIFFERENCE = 0.02
"""Of duration and of restitution from the measured ones [-], for a step that will do."""
CONTACTS_LONG = 2.5
STEPS_MORE = 20
"""A run lasts so many contact durations [-] and so many steps more [-], our choice: engines that
lose their way in coarse steps are given time to let go."""
SMALLEST_FORCE = 1e-6
"""Of the largest, above which bodies are in contact [-], our choice: what engines round to."""


@dataclass(frozen=True)
class Motion:
    """The bodies' speeds after each step.

    Attributes
    ----------
    contact : Contact
        What was to be shown.
    step : float
        [s]
    speeds : ndarray, shape (1 + steps, 2)
        Of hammer and sample along the line of impact [m/s], beginning with those before contact.
    """

    contact: Contact
    step: float
    speeds: FloatArray

    @property
    def force(self) -> FloatArray:
        """Mean force in each step [N], shape (steps,): the momentum that the hammer lost."""
        return np.asarray(-self.contact.hammer_mass * np.diff(self.speeds[:, 0]) / self.step)

    @property
    def time(self) -> FloatArray:
        """Of the middle of each step [s], shape (steps,)."""
        return np.asarray((np.arange(len(self.speeds) - 1) + 0.5) * self.step)

    @property
    def duration(self) -> float:
        """Of all steps with a force [s]."""
        force = np.abs(self.force)
        return float(np.count_nonzero(force > SMALLEST_FORCE * force.max()) * self.step)

    @property
    def restitution(self) -> float:
        """Speed of separation over impact speed [-]."""
        last = self.speeds[-1]
        return float((last[1] - last[0]) / self.contact.speed)

    @property
    def peak_force(self) -> float:
        """Largest mean force of a step [N]."""
        return float(self.force.max())


@dataclass(frozen=True)
class EngineCheck:
    """The two bodies in one engine.

    Attributes
    ----------
    parameters : Parameters
        What the engine was given.
    strikes : tuple of tuple of Motion
        From the coarsest step to the finest, each at all of `PHASES`.
    """

    parameters: Parameters
    strikes: tuple[tuple[Motion, ...], ...]

    @property
    def finest(self) -> Motion:
        """At the finest step."""
        return self.strikes[-1][0]

    @property
    def largest_step(self) -> float:
        """From which on duration and restitution are met [s]; NaN: from none of those tried."""
        good = math.nan
        for motions in reversed(self.strikes):
            if not is_met(motions):
                break
            good = motions[0].step
        return good


def is_met(motions: Sequence[Motion]) -> bool:
    """Return whether all have the contact's duration and restitution to `LARGEST_DIFFERENCE`."""
    return all(
        abs(found / wanted - 1.0) <= LARGEST_DIFFERENCE
        for motion in motions
        for found, wanted in (
            (motion.duration, motion.contact.duration),
            (motion.restitution, motion.contact.restitution),
        )
    )


def find_obstacle(engine: Engine) -> str:
    """Return why nothing can be checked in an engine, in a sentence; empty: it can."""
    if engine.name not in _STRIKES:
        checked = ", ".join(ENGINES[name].title for name in _STRIKES)
        return f"--check does not run in {engine.title}: it runs in {checked}"
    if importlib.util.find_spec(engine.module) is None:
        return (
            f"--check needs {engine.title}, which is not installed: pip install {engine.package}"
        )
    return ""


def check_engine(parameters: Parameters, steps: Sequence[float] = STEPS) -> EngineCheck:
    """Let the two bodies meet in an engine.

    Parameters
    ----------
    parameters : Parameters
        What the engine is given.
    steps : sequence of float
        From the coarsest to the finest [s].

    Raises
    ------
    ParameterError
        If the engine is not installed, or is none of those that are checked.
    """
    engine = parameters.engine
    if reason := find_obstacle(engine):
        raise ParameterError(reason)
    strike = _STRIKES[engine.name]
    return EngineCheck(
        parameters,
        tuple(tuple(strike(parameters, step, phase) for phase in PHASES) for step in steps),
    )


def _count_steps(contact: Contact, step: float) -> int:
    """Return how many steps are run."""
    return round(CONTACTS_LONG * contact.duration / step) + STEPS_MORE


def _compute_gap(contact: Contact, step: float, phase: float) -> float:
    """Return the distance at which bodies start [m], to touch after `phase` of the first step."""
    return phase * contact.speed * step


def _strike_in_mujoco(parameters: Parameters, step: float, phase: float) -> Motion:
    """Let the bodies of the exported model meet."""
    import mujoco

    contact = parameters.contact
    model = mujoco.MjModel.from_xml_string(format_text(parameters, ".xml"))
    model.opt.timestep = step
    state = mujoco.MjData(model)
    along_x = [model.body(name).dofadr[0] for name in ("hammer", "sample")]
    state.joint(0).qpos[0] -= _compute_gap(contact, step, phase)
    state.qvel[along_x[0]] = contact.speed
    speeds = [state.qvel[along_x].copy()]
    for _ in range(_count_steps(contact, step)):
        mujoco.mj_step(model, state)
        speeds.append(state.qvel[along_x].copy())
    return Motion(contact, step, np.array(speeds))


def _strike_in_drake(parameters: Parameters, step: float, phase: float) -> Motion:
    """Let the bodies of the exported SDFormat meet; lagged, which is Drake's own choice."""
    from pydrake.math import RigidTransform
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, DiscreteContactApproximation
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder

    contact = parameters.contact
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, step)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    models = Parser(plant).AddModelsFromString(format_text(parameters, ".sdf"), "sdf")
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    bodies = [plant.GetBodyByName("body", model) for model in models]
    gap = _compute_gap(contact, step, phase)
    for body, place in zip(bodies, (-gap, 2.0 * SPHERE_RADIUS), strict=True):
        plant.SetFreeBodyPose(context, body, RigidTransform([place, 0.0, 0.0]))
    along_x = [body.floating_velocities_start_in_v() + 3 for body in bodies]
    speeds = plant.GetVelocities(context)
    speeds[along_x[0]] = contact.speed
    plant.SetVelocities(context, speeds)
    simulator.Initialize()
    found = [speeds[along_x]]
    for number in range(1, _count_steps(contact, step) + 1):
        simulator.AdvanceTo(number * step)
        found.append(plant.GetVelocities(context)[along_x])
    return Motion(contact, step, np.array(found))


def _strike_in_pybullet(parameters: Parameters, step: float, phase: float) -> Motion:
    """Let two spheres meet, with the exported arguments of changeDynamics."""
    import pybullet

    contact = parameters.contact
    world = {"physicsClientId": pybullet.connect(pybullet.DIRECT)}
    try:
        pybullet.setTimeStep(step, **world)
        pybullet.setGravity(0.0, 0.0, 0.0, **world)
        # Otherwise bodies that have sunk into each other by 10 um do not touch yet.
        pybullet.setPhysicsEngineParameter(contactSlop=0.0, **world)
        shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=SPHERE_RADIUS, **world)
        places = (-_compute_gap(contact, step, phase), 2.0 * SPHERE_RADIUS)
        masses = (contact.hammer_mass, contact.sample_mass)
        bodies = [
            pybullet.createMultiBody(mass, shape, basePosition=[place, 0.0, 0.0], **world)
            for mass, place in zip(masses, places, strict=True)
        ]
        for body in bodies:
            pybullet.changeDynamics(
                body,
                -1,
                **{name: value.value for name, value in parameters.values.items()},
                linearDamping=0.0,  # of the air, 4 % in a second where nothing is said
                angularDamping=0.0,
                lateralFriction=0.0,
                **world,
            )
        pybullet.resetBaseVelocity(bodies[0], [contact.speed, 0.0, 0.0], **world)
        speeds = [(contact.speed, 0.0)]
        for _ in range(_count_steps(contact, step)):
            pybullet.stepSimulation(**world)
            speeds.append(tuple(pybullet.getBaseVelocity(body, **world)[0][0] for body in bodies))
    finally:
        pybullet.disconnect(**world)
    return Motion(contact, step, np.array(speeds))


_STRIKES: dict[str, Callable[[Parameters, float, float], Motion]] = {
    "mujoco": _strike_in_mujoco,
    "drake": _strike_in_drake,
    "pybullet": _strike_in_pybullet,
}
"""Two bodies in the engines in which that can be checked, at steps of some seconds; they touch
after a part of one."""
