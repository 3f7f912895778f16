"""The two bodies in PyBullet, with the exported arguments of changeDynamics."""

import numpy as np

from impact_rig.simulators.motion import Motion, compute_gap, count_steps
from impact_rig.simulators.parameters import Parameters
from impact_rig.simulators.texts import SPHERE_RADIUS


def strike(parameters: Parameters, step: float, phase: float) -> Motion:
    """Let the bodies meet, at steps of `step` seconds; they touch after `phase` of one."""
    import pybullet

    contact = parameters.contact
    world = {"physicsClientId": pybullet.connect(pybullet.DIRECT)}
    try:
        pybullet.setTimeStep(step, **world)
        pybullet.setGravity(0.0, 0.0, 0.0, **world)
        # Otherwise bodies that have sunk into each other by 10 um do not touch yet.
        pybullet.setPhysicsEngineParameter(contactSlop=0.0, **world)
        shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=SPHERE_RADIUS, **world)
        places = (-compute_gap(contact, step, phase), 2.0 * SPHERE_RADIUS)
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
        for _ in range(count_steps(contact, step)):
            pybullet.stepSimulation(**world)
            speeds.append(tuple(pybullet.getBaseVelocity(body, **world)[0][0] for body in bodies))
    finally:
        pybullet.disconnect(**world)
    return Motion(contact, step, np.array(speeds))
