"""The sensors that a recording was made with, by its set-ups."""

import contextlib
from datetime import UTC, datetime

from impact_rig.core.errors import RigError
from impact_rig.core.setup.calibration_age import find_calibration_warning
from impact_rig.core.setup.sensors import Sensor
from impact_rig.recording.interfaces.messages import setup_from_msg
from impact_rig.recording.recovery.contents import Contents


def find_sensors(contents: Contents) -> tuple[Sensor, ...]:
    """Return the sensors of all set-ups of a recording, each once."""
    found: list[Sensor] = []
    for message in contents.setups:
        # Whatever else is wrong with a set-up: `analyze` tells.
        with contextlib.suppress(RigError, AttributeError, TypeError):
            found += setup_from_msg(message).sensors
    # By their words: a sensitivity that is not known (NaN) is not equal to itself.
    return tuple({(item.channel, item.describe()): item for item in found}.values())


def list_sensors(contents: Contents) -> list[str]:
    """Return each sensor in words."""
    return [f"{sensor.channel}: {sensor.describe()}" for sensor in find_sensors(contents)]


def find_sensor_warnings(contents: Contents) -> list[str]:
    """Return which sensors' calibrations were too old on the day of the recording."""
    try:
        day = datetime.fromtimestamp(contents.start_time * 1e-9, tz=UTC).date().isoformat()
    except (OverflowError, OSError, ValueError):
        return []
    found = [find_calibration_warning(sensor, day) for sensor in find_sensors(contents)]
    return [text for text in found if text]
