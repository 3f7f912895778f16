"""The two bodies in Drake, from the exported SDFormat."""

import numpy as np

from impact_rig.simulators.motion import Motion, compute_gap, count_steps
from impact_rig.simulators.parameters import Parameters
from impact_rig.simulators.texts import SPHERE_RADIUS, format_text


def strike(parameters: Parameters, step: float, phase: float) -> Motion:
    """Let the bodies meet, at steps of `step` seconds; they touch after `phase` of one.

    The approximation is the lagged one, Drake's own choice.
    """
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
    gap = compute_gap(contact, step, phase)
    for body, place in zip(bodies, (-gap, 2.0 * SPHERE_RADIUS), strict=True):
        plant.SetFreeBodyPose(context, body, RigidTransform([place, 0.0, 0.0]))
    along_x = [body.floating_velocities_start_in_v() + 3 for body in bodies]
    speeds = plant.GetVelocities(context)
    speeds[along_x[0]] = contact.speed
    plant.SetVelocities(context, speeds)
    simulator.Initialize()
    found = [speeds[along_x]]
    for number in range(1, count_steps(contact, step) + 1):
        simulator.AdvanceTo(number * step)
        found.append(plant.GetVelocities(context)[along_x])
    return Motion(contact, step, np.array(found))
