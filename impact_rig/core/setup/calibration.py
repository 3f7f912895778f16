"""Units that instruments write, and the accelerations that they stand for."""

import math
from dataclasses import dataclass

from impact_rig.core.checks import check_positive
from impact_rig.core.errors import ParameterError

STANDARD_GRAVITY = 9.80665
"""[m/s^2], by definition."""
POUND_FORCE = 4.4482216152605
"""[N], by definition."""

ACCELERATIONS = {"m/s^2": 1.0, "g": STANDARD_GRAVITY, "kgn": 1e3 * STANDARD_GRAVITY}
"""Units of acceleration [m/s^2]; kgn: a thousand g."""
FORCES = {"N": 1.0, "kN": 1e3, "lbf": POUND_FORCE, "kgf": STANDARD_GRAVITY}
"""Units of force [N]."""
VOLTAGES = {"V": 1.0, "mV": 1e-3}
"""Units of voltage [V]."""
UNITS = (*ACCELERATIONS, *FORCES, *VOLTAGES)

SPELLINGS = {
    "m/s²": "m/s^2", "m/s2": "m/s^2", "m/s**2": "m/s^2", "m/s/s": "m/s^2", "m s^-2": "m/s^2",
    "m/(s^2)": "m/s^2", "m/sec^2": "m/s^2", "ms^-2": "m/s^2", "G": "g", "gn": "g", "g_n": "g",
    "ms-2": "m/s^2", "m/s-2": "m/s^2", "ms⁻²": "m/s^2", "m s⁻²": "m/s^2", "m·s⁻²": "m/s^2",
    "kg": "kgn", "kG": "kgn", "kg_n": "kgn", "lb": "lbf", "lbs": "lbf", "kp": "kgf",
    "g0": "g", "newton": "N", "Newton": "N", "volt": "V", "Volt": "V", "volts": "V", "Volts": "V",
    "VOLT": "V", "v": "V", "VOLTS": "V", "mVolt": "mV", "millivolts": "mV",
}  # fmt: skip
"""How files write these units, too."""

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
"""Units of times [s]."""
SAMPLES = "samples"
"""What a column counts that numbers its points."""
TIME_SPELLINGS = {
    "µs": "us", "μs": "us", "sec": "s", "sek": "s", "msec": "ms", "usec": "us", "µsec": "us",
    "nsec": "ns", "second": "s", "millisecond": "ms", "microsecond": "us", "nanosecond": "ns",
    "minute": "min", "sample": SAMPLES, "point": SAMPLES, "pt": SAMPLES, "index": SAMPLES,
    "sequence": SAMPLES, "#": SAMPLES,
}  # fmt: skip
"""How files write these, too, in small letters and without the s of the plural."""


def normalize_time_unit(unit: str) -> str:
    """Return how a unit of time is written here, or `SAMPLES`; empty: it is none."""
    name = unit.strip().lower()
    name = name if name in TIME_UNITS or name in TIME_SPELLINGS else name.removesuffix("s")
    return name if name in TIME_UNITS else TIME_SPELLINGS.get(name, "")


@dataclass(frozen=True)
class Sensitivity:
    """What a sensor gives.

    Attributes
    ----------
    voltage : float
        For one `unit` [V]; negative: the sensor looks the other way.
    unit : str
        Of acceleration or force.
    """

    voltage: float
    unit: str

    def __post_init__(self) -> None:
        """Refuse a sensitivity of nothing and a unit that is none of acceleration or force."""
        if not math.isfinite(self.voltage) or self.voltage == 0.0:
            raise ParameterError(f"sensitivity is {self.voltage!r} V: it must not be zero")
        unit = normalize_unit(self.unit)
        if unit not in ACCELERATIONS and unit not in FORCES:
            raise ParameterError(
                f"sensitivity is per {self.unit!r}: it must be a voltage per"
                f" {', '.join((*ACCELERATIONS, *FORCES))}, for example 10 mV/g"
            )


def normalize_unit(unit: str) -> str:
    """Return how a unit is written here; unchanged if it is unknown."""
    return SPELLINGS.get(unit.strip(), unit.strip())


def list_units() -> str:
    """Return all units, for messages."""
    return ", ".join(UNITS[:-1]) + f" or {UNITS[-1]}"


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
        raise ParameterError(f"unit {unit!r} is unknown: a channel is in {list_units()}")
    if sensitivity is None:
        raise ParameterError(f"a channel in {unit} needs a sensitivity, for example 10 mV/g")
    return VOLTAGES[name] * compute_scale(sensitivity.unit, mass) / sensitivity.voltage
