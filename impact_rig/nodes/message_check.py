"""Messages are checked once, when they come: what cannot be meant is dropped, and ends no node."""

import math
from collections.abc import Callable
from typing import Any

from impact_rig_msgs import msg

from impact_rig.core.errors import ParameterError, RigError
from impact_rig.nodes.guarded_hammer import Disarming, HammerPlace
from impact_rig.nodes.interfaces import Topic
from impact_rig.recordings.messages import block_from_msg, origin_from_msg, setup_from_msg


def _check_hammer_state(message: msg.HammerState) -> None:
    HammerPlace(message.state)
    Disarming(message.disarmed_by)


def _check_acquisition_state(message: msg.AcquisitionState) -> None:
    if message.state > message.FAULT:
        raise ParameterError(f"state is {message.state}: it must not be above {message.FAULT}")


def _check_release(message: msg.HammerRelease) -> None:
    for name in ("swing_time", "latest_contact"):
        value = getattr(message, name)
        if not (math.isfinite(value) and value >= 0.0):
            raise ParameterError(f"{name} is {value:g} s: it must be zero or more")


def _check_comparison(message: msg.ModelComparison) -> None:
    if not (math.isfinite(message.sampling_rate) and message.sampling_rate > 0.0):
        raise ParameterError(f"sampling_rate is {message.sampling_rate:g} Hz: it must be above 0")
    sizes = {
        len(trace)
        for trace in (
            message.hammer_measured, message.hammer_model, message.specimen_measured,
            message.specimen_model,
        )
    }  # fmt: skip
    if len(sizes) != 1:
        raise ParameterError(f"its traces have {sorted(sizes)} points: they must be as long")


CHECKS: dict[type, Callable[[Any], object]] = {
    msg.AccelerationBlock: block_from_msg,
    msg.AcquisitionState: _check_acquisition_state,
    msg.HammerRelease: _check_release,
    msg.HammerState: _check_hammer_state,
    msg.Impact: origin_from_msg,
    msg.ModelComparison: _check_comparison,
    msg.RigSetup: setup_from_msg,
    msg.StreamBlock: block_from_msg,
}
"""What raises if a message cannot be meant; of the other types any values can."""


def find_problem(topic: Topic, message: Any) -> str | None:
    """Return why a message cannot be meant; None: it is sound."""
    if check := CHECKS.get(topic.type):
        try:
            check(message)
        except (RigError, ValueError, OverflowError) as error:
            return str(error)
    return None
