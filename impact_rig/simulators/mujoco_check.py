"""The two bodies in MuJoCo, from the exported model."""

import numpy as np

from impact_rig.simulators.motion import Motion, compute_gap, count_steps
from impact_rig.simulators.parameters import Parameters
from impact_rig.simulators.texts import format_text


def strike(parameters: Parameters, step: float, phase: float) -> Motion:
    """Let the bodies meet, at steps of `step` seconds; they touch after `phase` of one."""
    import mujoco

    contact = parameters.contact
    model = mujoco.MjModel.from_xml_string(format_text(parameters, ".xml"))
    model.opt.timestep = step
    state = mujoco.MjData(model)
    along_x = [model.body(name).dofadr[0] for name in ("hammer", "sample")]
    state.joint(0).qpos[0] -= compute_gap(contact, step, phase)
    state.qvel[along_x[0]] = contact.speed
    speeds = [state.qvel[along_x].copy()]
    for _ in range(count_steps(contact, step)):
        mujoco.mj_step(model, state)
        speeds.append(state.qvel[along_x].copy())
    return Motion(contact, step, np.array(speeds))
