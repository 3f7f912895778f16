"""Plan of a campaign: from a goal, or from the recordings of a run."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from builtin_interfaces.msg import Time
from impact_rig_msgs import msg
from impact_rig_msgs.action import RunCampaign
from rclpy.serialization import deserialize_message

from impact_rig.configuration.rig_file import make_check_mass
from impact_rig.core.given.errors import FileError, ParameterError
from impact_rig.core.given.setup import RigSetup, Sample
from impact_rig.nodes.identity import id_from_msg, id_to_msg, make_id
from impact_rig.nodes.messages import setup_to_msg
from impact_rig.recordings.fields import NO_ID
from impact_rig.recordings.messages import SETUP_TYPE, setup_from_msg
from impact_rig.recordings.run import Run


def plan_campaign(
    goal: RunCampaign.Goal,
    setup: RigSetup,
    angles: Sequence[float],
    stamp: Time,
    check_mass: Sample | None = None,
) -> msg.RigSetup:
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
    check_mass : Sample or None
        That is due by the rig file; None: there is none, or it was struck today.

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
    samples = list(goal.samples) or list(setup.samples.names)
    for name in samples:
        setup.samples.find(name)
        if samples.count(name) > 1:
            raise ParameterError(f"sample {name!r} is asked for twice: once is enough")
    if angles := list(goal.release_angles) or angles:
        setup = setup.at_angles(angles)
    series = setup.samples.find_series(samples)
    if goal.check_mass:
        check_mass = make_check_mass(goal.check_mass, goal.check_mass_uncertainty)
    if check_mass is not None:
        setup = replace(setup, samples=setup.samples.with_check(check_mass))
        series = (check_mass.name, *series)
    message = setup_to_msg(setup, stamp)
    asked = id_from_msg(goal.campaign_id)
    message.campaign_id = id_to_msg(make_id() if asked == NO_ID else asked)
    message.plan = msg.CampaignPlan(
        samples=series,
        impacts=goal.impacts,
        attempts_per_impact=goal.attempts_per_impact,
        confirm_samples=goal.confirm_samples,
        trial=goal.trial,
    )
    return message


def read_newest_campaign(folder: Path) -> msg.RigSetup:
    """Return the set-up of the newest campaign in the recordings of a run, as a message.

    Raises
    ------
    FileError
        If there is none.
    """
    newest: msg.RigSetup | None = None
    for raw in Run(folder).read_messages({SETUP_TYPE}):
        message = deserialize_message(raw.data, msg.RigSetup)
        if message.plan.impacts:
            newest = message
    if newest is None:
        raise FileError(f"{folder} holds no campaign that could go on")
    return newest
