"""How old the calibration of a sensor is."""

from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.setup.sensors import Sensor

LONGEST_INTERVAL = 1
"""Age of a calibration above which a warning is due [years]: the interval that makers of
accelerometers and force sensors usually recommend."""


def list_calibration_warnings(setup: RigSetup, today: str) -> tuple[str, ...]:
    """Return in one sentence each which sensors were calibrated too long ago.

    Parameters
    ----------
    setup : RigSetup
        Its sensors are looked at; those without a date are not told of.
    today : str
        Day on which they are used, year-month-day.
    """
    found = (describe_calibration_age(sensor, today) for sensor in setup.sensors)
    return tuple(text for text in found if text)


def describe_calibration_age(sensor: Sensor, today: str) -> str:
    """Return what is to be said of a sensor's calibration on a day; empty: nothing."""
    day = sensor.calibration_date
    if not day:
        return ""
    serial = f" {sensor.serial_number}" if sensor.serial_number else ""
    told = f"the {sensor.channel} sensor{serial} was calibrated on {day}"
    year, rest = today[:4], today[4:]
    # Days written year-month-day sort as texts.
    if day < f"{int(year) - LONGEST_INTERVAL:04d}{rest}":
        return f"{told}, over a year before {today}: have it calibrated anew"
    if day > today:
        return f"{told}, which lies ahead of {today}: check calibration_date and this clock"
    return ""
