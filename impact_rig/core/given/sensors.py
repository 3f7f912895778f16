"""Channels as they are: units, sensitivity, resonance, lower corner, and their use."""

import math
import re
from dataclasses import dataclass, field

from impact_rig.core.given.errors import (
    ParameterError,
    check_choice,
    check_not_negative,
    check_positive,
)
from impact_rig.core.given.quantity import Comparable, describe, stated_field

STANDARD_GRAVITY = 9.80665
"""[m/s^2], by definition."""

ACCELERATIONS = {
    "m/s^2": 1.0, "g": STANDARD_GRAVITY, "kgn": 1e3 * STANDARD_GRAVITY,
    "mg": 1e-3 * STANDARD_GRAVITY, "ug": 1e-6 * STANDARD_GRAVITY, "mm/s^2": 1e-3, "cm/s^2": 1e-2,
    "in/s^2": 0.0254, "ft/s^2": 0.3048,
}  # fmt: skip
"""Units of acceleration [m/s^2]; kgn: a thousand g."""
FORCES = {
    "N": 1.0, "kN": 1e3, "mN": 1e-3, "lbf": 4.4482216152605, "kgf": STANDARD_GRAVITY,
    "ozf": 4.4482216152605 / 16.0, "dyn": 1e-5,
}  # fmt: skip
"""Units of force [N]; the pound by definition."""
VOLTAGES = {"V": 1.0, "mV": 1e-3}
"""Units of voltage [V]."""
UNITS = (*ACCELERATIONS, *FORCES, *VOLTAGES)

SPELLINGS = {
    "m/s²": "m/s^2", "m/s2": "m/s^2", "m/s**2": "m/s^2", "m/s/s": "m/s^2", "m s^-2": "m/s^2",
    "m/(s^2)": "m/s^2", "m/sec^2": "m/s^2", "ms^-2": "m/s^2", "G": "g", "gn": "g", "g_n": "g",
    "ms2": "m/s^2", "m_s2": "m/s^2", "ms-2": "m/s^2", "m/s-2": "m/s^2",
    "ms⁻²": "m/s^2", "m s⁻²": "m/s^2", "m·s⁻²": "m/s^2",
    "kg": "kgn", "kG": "kgn", "kg_n": "kgn", "lb": "lbf", "lbs": "lbf", "kp": "kgf",
    "g0": "g", "newton": "N", "Newton": "N", "volt": "V", "Volt": "V", "volts": "V", "Volts": "V",
    "mG": "mg", "milli-g": "mg", "µg": "ug", "μg": "ug", "Gal": "cm/s^2", "dyne": "dyn",
    "oz": "ozf", "VOLT": "V", "v": "V", "VOLTS": "V", "mVolt": "mV", "millivolts": "mV",
}  # fmt: skip
"""Other spellings of these units in files."""
LENGTH_PER_SECOND = re.compile(r"(in|ft|mm|cm)/s(?:ec)?(?:²|\^?2|\*\*2)")
"""Spellings of accelerations in other lengths than metres."""


@dataclass(frozen=True)
class Sensitivity:
    """Sensitivity of a sensor."""

    voltage: float  # for one `unit` [V]; negative: the sensor looks the other way
    unit: str  # of acceleration or force

    def __post_init__(self) -> None:
        """Refuse a sensitivity of zero and a unit of neither acceleration nor force."""
        if not math.isfinite(self.voltage) or self.voltage == 0.0:
            raise ParameterError(
                f"sensitivity is {self.voltage!r} V: it must not be zero", "sensitivity"
            )
        unit = normalize_unit(self.unit)
        if unit not in ACCELERATIONS and unit not in FORCES:
            raise ParameterError(
                f"sensitivity is per {self.unit!r}: it must be a voltage per"
                f" {', '.join((*ACCELERATIONS, *FORCES))}, for example 10 mV/g",
                "sensitivity",
            )


def normalize_unit(unit: str) -> str:
    """Return how a unit is written here; unchanged if it is unknown."""
    name = unit.strip()
    length = LENGTH_PER_SECOND.fullmatch(name)
    return f"{length[1]}/s^2" if length else SPELLINGS.get(name, name)


def compute_scale(
    unit: str, mass: float = math.nan, sensitivity: Sensitivity | None = None
) -> float:
    """Return the acceleration that one unit of a channel stands for.

    Parameters
    ----------
    unit : str
        One of `UNITS`, in any of its spellings.
    mass : float
        Of the body that a force acts on [kg]: force is mass times acceleration; NaN: not known.
    sensitivity : Sensitivity, optional
        Of the sensor behind a voltage.

    Returns
    -------
    float
        [m/s^2 per unit]

    Raises
    ------
    ParameterError
        If the unit is unknown, a force has no mass, or a voltage no sensitivity.
    """
    name = normalize_unit(unit)
    if name in ACCELERATIONS:
        return ACCELERATIONS[name]
    if name in FORCES:
        if math.isnan(mass):
            raise ParameterError(
                f"a channel in {unit} needs the hammer's mass: acceleration is F/m"
            )
        check_positive("hammer mass", mass, "kg")
        return FORCES[name] / mass
    if name not in VOLTAGES:
        raise ParameterError(f"unit {unit!r} is unknown: a channel is in {', '.join(UNITS)}")
    if sensitivity is None:
        raise ParameterError(f"a channel in {unit} needs a sensitivity, for example 10 mV/g")
    return VOLTAGES[name] * compute_scale(sensitivity.unit, mass) / sensitivity.voltage


CHANNELS = ("hammer", "specimen")
"""The rig's channels: the body that a sensor sits in or on."""
QUANTITIES = {"acceleration": tuple(ACCELERATIONS), "force": tuple(FORCES)}
"""Quantities that a sensor may measure, with their units."""
_DATE = re.compile(r"\d{4}-\d{2}-\d{2}")


DEFAULT_RESONANCE_DAMPING = 0.02
"""Damping of a mounted accelerometer's resonance without a stated one [-], our choice."""


@dataclass(frozen=True)
class SensorResponse(Comparable):
    """Response of a sensor and its amplifier: a resonance, a high-pass, a low-pass of one pole."""

    resonance: float = 0.0  # as mounted [Hz]; 0: too high to matter, or not known
    damping: float = DEFAULT_RESONANCE_DAMPING  # of the resonance, over critical [-]
    low_corner: float = 0.0  # -3 dB at the low end [Hz]; 0: none that matters, or not known
    upper_corner: float = 0.0  # -3 dB of coupler or amplifier [Hz]; 0: the same

    @property
    def is_flat(self) -> bool:
        """Whether it shows what it measures as it is."""
        return not (self.resonance or self.low_corner or self.upper_corner)

    def scale(self, factor: float) -> "SensorResponse":
        """Return it with its frequencies in another unit, `factor` times as many."""
        return SensorResponse(
            self.resonance * factor,
            self.damping,
            self.low_corner * factor,
            self.upper_corner * factor,
        )


FLAT = SensorResponse()
"""Response of a sensor without a stated one."""


@dataclass(frozen=True)
class Sensor(Comparable):
    """Calibration sheet of a channel's sensor."""

    channel: str  # one of `CHANNELS`
    quantity: str = "acceleration"  # one of `QUANTITIES`: a force is that on the hammer's mass
    unit: str = "m/s^2"  # of the quantity
    # For one `unit` [V], signed; NaN: the source gives the quantity itself and needs none.
    sensitivity: float = field(default=math.nan, metadata=describe("V per unit"))
    # Largest value that the sensor takes, either sign [unit]; 0: not known.
    full_scale: float = 0.0
    serial_number: str = ""  # as on the sensor; empty: not known
    calibration_date: str = ""  # of the sheet, year-month-day; empty: not known
    # Relative standard uncertainty of the channel's gain [-]; 0: not stated.
    sensitivity_uncertainty: float = stated_field("", "sensitivity_u")
    resonance: float = field(default=0.0, metadata=describe("Hz"))  # as in `SensorResponse`
    # Their standard uncertainties [Hz]; 0: not stated.
    resonance_uncertainty: float = stated_field("Hz", "resonance_u")
    resonance_damping: float = DEFAULT_RESONANCE_DAMPING
    low_corner: float = field(default=0.0, metadata=describe("Hz"))
    low_corner_uncertainty: float = stated_field("Hz", "low_corner_u")
    upper_corner: float = field(default=0.0, metadata=describe("Hz"))
    upper_corner_uncertainty: float = stated_field("Hz", "upper_corner_u")

    def __post_init__(self) -> None:
        """Refuse what cannot be meant."""
        check_choice("sensor channel", self.channel, CHANNELS)
        name = f"{self.channel} sensor"
        check_choice(f"quantity of the {name}", self.quantity, QUANTITIES)
        if self.quantity == "force" and self.channel != "hammer":
            raise ParameterError(
                f"the {name} measures a force: on the sample it must be an acceleration"
            )
        object.__setattr__(self, "unit", normalize_unit(self.unit))
        if self.unit not in QUANTITIES[self.quantity]:
            raise ParameterError(
                f"unit of the {name} is {self.unit!r}: {self.quantity} is in one of"
                f" {', '.join(QUANTITIES[self.quantity])}",
                f"unit of the {name}",
            )
        check_not_negative(f"full scale of the {name}", self.full_scale, self.unit)
        if self.calibration_date and not _DATE.fullmatch(self.calibration_date):
            raise ParameterError(
                f"calibration date of the {name} is {self.calibration_date!r}: write it as"
                " year-month-day, like 2026-03-01",
                f"calibration date of the {name}",
            )
        what = f"uncertainty of the sensitivity of the {name}"
        check_not_negative(what, self.sensitivity_uncertainty, "")
        for field_name in ("resonance", "low_corner", "upper_corner"):
            what, standard = (
                field_name.replace("_", " "),
                getattr(self, f"{field_name}_uncertainty"),
            )
            check_not_negative(f"{what} of the {name}", getattr(self, field_name), "Hz")
            check_not_negative(f"uncertainty of the {what} of the {name}", standard, "Hz")
        _check_response(name, self.response)

    @property
    def response(self) -> SensorResponse:
        """Its response."""
        return SensorResponse(
            self.resonance, self.resonance_damping, self.low_corner, self.upper_corner
        )

    def compute_scale(self, moving_mass: float = math.nan) -> float:
        """Return the acceleration that one volt stands for [m/s^2 per V].

        Parameters
        ----------
        moving_mass : float
            Of the body that a force acts on [kg]; needed for a force only.

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
        return compute_scale("V", moving_mass, Sensitivity(self.sensitivity, self.unit))

    def compute_full_scale(self, moving_mass: float = math.nan) -> float:
        """Return the largest acceleration that the sensor takes [m/s^2]; 0: not known.

        Parameters and errors as `compute_scale`; a sensitivity is not needed.
        """
        return self.full_scale * compute_scale(self.unit, moving_mass) if self.full_scale else 0.0

    def describe_age(self, today: str) -> str | None:
        """Return a warning of its calibration's age on a day, year-month-day."""
        name = f"{self.channel} sensor {self.serial_number}".rstrip()
        return describe_calibration_age(name, self.calibration_date, today)

    def describe(self) -> str:
        """Return the sensor's properties in a few words."""
        known = [self.quantity]
        if not math.isnan(self.sensitivity):
            known.append(f"{self.sensitivity * 1e3:.6g} mV per {self.unit}")
        if self.full_scale:
            known.append(f"up to {self.full_scale:.6g} {self.unit}")
        if self.serial_number:
            known.append(f"serial number {self.serial_number}")
        if self.calibration_date:
            known.append(f"calibrated {self.calibration_date}")
        if self.resonance:
            known.append(f"resonance {self.resonance * 1e-3:.6g} kHz")
            default = ", the default" * (self.resonance_damping == DEFAULT_RESONANCE_DAMPING)
            known.append(f"damping {self.resonance_damping:g}{default}")
        if self.low_corner:
            known.append(f"low corner {self.low_corner:.6g} Hz")
        if self.upper_corner:
            known.append(f"upper corner {self.upper_corner * 1e-3:.6g} kHz")
        return ", ".join(known)


def _check_response(name: str, response: SensorResponse) -> None:
    """Refuse a response that no sensor has; raises `ParameterError` that names the sensor."""
    if not 0.0 < response.damping <= 1.0:
        raise ParameterError(
            f"resonance damping of the {name} is {response.damping!r}: it must be above 0 and 1 at"
            " most, of critical damping",
            f"resonance damping of the {name}",
        )
    others = {"resonance": response.resonance, "upper corner": response.upper_corner}
    for what, above in others.items():
        if above and response.low_corner >= above:
            raise ParameterError(
                f"low corner of the {name} is {response.low_corner:g} Hz: it must lie below the"
                f" {what} of {above:g} Hz",
                f"low corner of the {name}",
            )


def describe_calibration_age(name: str, day: str, today: str, due: str = "") -> str | None:
    """Return a warning of the age of an instrument's calibration; all days year-month-day.

    A day that is written in another way, or not known, says nothing.
    """
    # Days written year-month-day sort as texts.
    if due and due < today:
        return f"the calibration of the {name} was due on {due}, before {today}"
    if not (today and _DATE.fullmatch(day)):
        return None
    told = f"the {name} was calibrated on {day}"
    # Where no day is due: makers of accelerometers and force sensors recommend a year.
    if not due and day < f"{int(today[:4]) - 1:04d}{today[4:]}":
        return f"{told}, over a year before {today}: have it calibrated again"
    if day > today:
        return f"{told}, which lies ahead of {today}: check calibration_date and this clock"
    return None
