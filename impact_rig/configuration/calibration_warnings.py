"""What is to be said of a rig's sensors before it is used today."""

from datetime import datetime

from impact_rig.core.setup.calibration_age import find_calibration_warnings
from impact_rig.core.setup.samples import RigSetup


def find_rig_warnings(setup: RigSetup) -> tuple[str, ...]:
    """Return which calibrations are too old on this day."""
    return find_calibration_warnings(setup, find_today())


def find_today() -> str:
    """Return the day here, year-month-day."""
    return datetime.now().astimezone().date().isoformat()
