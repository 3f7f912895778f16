"""What a goal asks for, as the set-up of a new campaign, or the reason why it cannot be run."""

from collections.abc import Sequence
from dataclasses import replace

from builtin_interfaces.msg import Time
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import CampaignPlan
from impact_rig_msgs.msg import RigSetup as RigSetupMessage

from impact_rig.core.errors import ParameterError
from impact_rig.core.setup import RigSetup
from impact_rig.nodes import messages
from impact_rig.nodes.identity import id_to_msg, make_id
from impact_rig.recordings.messages import setup_from_msg


def plan_campaign(
    goal: RunCampaign.Goal, setup: RigSetup, angles: Sequence[float], stamp: Time
) -> RigSetupMessage:
    """Return the set-up of the campaign that a goal asks for, with its id and its plan.

    Parameters
    ----------
    goal : RunCampaign.Goal
        Of a new campaign, or of one that goes on.
    setup : RigSetup
        Of the rig file.
    angles : sequence of float
        Release angles of the rig file [rad].
    stamp : Time
        When the campaign begins.

    Raises
    ------
    ParameterError
        If the goal cannot be run.
    """
    if goal.resumed.plan.impacts:
        setup_from_msg(goal.resumed)
        goal.resumed.plan.confirm_samples = goal.confirm_samples
        return goal.resumed
    if goal.impacts < 1:
        raise ParameterError("impacts is 0: a campaign needs at least 1 per sample")
    if goal.keep_hits > goal.impacts:
        raise ParameterError(
            f"keep_hits is {goal.keep_hits} of {goal.impacts} impacts: no more hits can be"
            " kept than are struck"
        )
    samples = list(goal.samples) or list(setup.samples.names)
    for name in samples:
        setup.samples.find(name)
        if samples.count(name) > 1:
            raise ParameterError(f"sample {name!r} is asked for twice: once is enough")
    if angles := list(goal.release_angles) or angles:
        setup = setup.at_angles(angles)
    if goal.keep_hits:
        setup = replace(setup, analysis=replace(setup.analysis, keep_hits=goal.keep_hits))
    message = messages.setup_to_msg(setup, stamp)
    message.campaign_id = id_to_msg(make_id())
    message.plan = CampaignPlan(
        samples=setup.samples.find_series(samples),
        impacts=goal.impacts,
        attempts_per_impact=goal.attempts_per_impact,
        confirm_samples=goal.confirm_samples,
    )
    return message
