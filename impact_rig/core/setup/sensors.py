"""The sensors behind the channels, by their calibration sheets."""

import math
import re
from dataclasses import dataclass

from impact_rig.core.checks import check_not_negative
from impact_rig.core.errors import ParameterError
from impact_rig.core.setup.calibration import (
    ACCELERATIONS,
    FORCES,
    Sensitivity,
    find_scale,
    normalize_unit,
)

CHANNELS = ("hammer", "specimen")
"""The rig's channels: the body that a sensor sits in or on."""
QUANTITIES = {"acceleration": tuple(ACCELERATIONS), "force": tuple(FORCES)}
"""What a sensor may measure, in which units."""
_DATE = re.compile(r"\d{4}-\d{2}-\d{2}")


@dataclass(frozen=True)
class Sensor:
    """What the calibration sheet of a channel's sensor says.

    Attributes
    ----------
    channel : str
        One of `CHANNELS`.
    quantity : str
        One of `QUANTITIES`: a force is that on the hammer's mass.
    unit : str
        Of the quantity.
    sensitivity : float
        For one `unit` [V], signed; NaN: the source gives the quantity itself and needs none.
    full_scale : float
        Largest value that the sensor takes, either sign [unit]; 0: not known.
    serial_number : str
        As on the sensor; empty: not known.
    calibration_date : str
        Of the sheet, year-month-day; empty: not known.
    """

    channel: str
    quantity: str = "acceleration"
    unit: str = "m/s^2"
    sensitivity: float = math.nan
    full_scale: float = 0.0
    serial_number: str = ""
    calibration_date: str = ""

    def __post_init__(self) -> None:
        """Refuse what cannot be meant."""
        if self.channel not in CHANNELS:
            raise ParameterError(
                f"sensor channel is {self.channel!r}: it must be one of {', '.join(CHANNELS)}"
            )
        name = f"{self.channel} sensor"
        if self.quantity not in QUANTITIES:
            raise ParameterError(
                f"quantity of the {name} is {self.quantity!r}: it must be one of"
                f" {', '.join(QUANTITIES)}"
            )
        if self.quantity == "force" and self.channel != "hammer":
            raise ParameterError(
                f"the {name} measures a force: on the sample it must be an acceleration"
            )
        object.__setattr__(self, "unit", normalize_unit(self.unit))
        if self.unit not in QUANTITIES[self.quantity]:
            raise ParameterError(
                f"unit of the {name} is {self.unit!r}: {self.quantity} is in one of"
                f" {', '.join(QUANTITIES[self.quantity])}"
            )
        if math.isinf(self.sensitivity) or self.sensitivity == 0.0:
            raise ParameterError(
                f"sensitivity of the {name} is {self.sensitivity!r} V per {self.unit}: it must be"
                " a finite number, not zero"
            )
        check_not_negative(f"full scale of the {name}", self.full_scale, self.unit)
        if self.calibration_date and not _DATE.fullmatch(self.calibration_date):
            raise ParameterError(
                f"calibration date of the {name} is {self.calibration_date!r}: write it as"
                " year-month-day, like 2026-03-01"
            )

    def find_scale(self, moving_mass: float = math.nan) -> float:
        """Return the acceleration that one volt stands for.

        Parameters
        ----------
        moving_mass : float
            Of the body that a force acts on [kg]; needed for a force only.

        Returns
        -------
        float
            [m/s^2 per V]

        Raises
        ------
        ParameterError
            If the sensor has no sensitivity, or a force no mass.
        """
        if math.isnan(self.sensitivity):
            raise ParameterError(
                f"the {self.channel} sensor has no sensitivity: a channel in V needs one, for"
                ' example sensitivity = "10 mV/g"'
            )
        return find_scale("V", moving_mass, Sensitivity(self.sensitivity, self.unit))

    def find_full_scale(self, moving_mass: float = math.nan) -> float:
        """Return the largest acceleration that the sensor takes [m/s^2]; 0: not known.

        Parameters and errors as `find_scale`; a sensitivity is not needed.
        """
        return self.full_scale * find_scale(self.unit, moving_mass) if self.full_scale else 0.0

    def describe(self) -> str:
        """Return what is known of the sensor, in a few words."""
        known = [self.quantity]
        if not math.isnan(self.sensitivity):
            known.append(f"{self.sensitivity * 1e3:.6g} mV per {self.unit}")
        if self.full_scale:
            known.append(f"up to {self.full_scale:.6g} {self.unit}")
        if self.serial_number:
            known.append(f"serial number {self.serial_number}")
        if self.calibration_date:
            known.append(f"calibrated {self.calibration_date}")
        return ", ".join(known)
