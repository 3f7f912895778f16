"""Plain traces of other laboratories as records of one hit."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from impact_rig.core.checks import check_not_negative, check_positive
from impact_rig.core.errors import ParameterError, SignalError
from impact_rig.core.signals.record import FloatArray, HitLabel, Record, Trace
from impact_rig.recording.tables import read_table

STANDARD_GRAVITY = 9.80665
"""[m/s^2], by definition."""

ROLES = ("time", "hammer", "specimen", "skip")
"""What a column may hold: time [s], the hammer's or the sample's signal, or nothing of use."""

DEFAULT_ROLES = {1: ("hammer",), 2: ("time", "hammer"), 3: ("time", "hammer", "specimen")}
"""Roles by number of columns, where none are given."""
DEFAULT_ROLES_WITHOUT_TIME = {1: ("hammer",), 2: ("hammer", "specimen")}
"""The same, where the sampling rate is given."""

MINIMUM_POINTS = 16
"""Shortest trace that is taken for one [points], our choice: a pulse and some baseline."""

RATE_DIGITS = 9
"""Digits that a sampling rate found in a time column is rounded to, our choice: files of one
series get the same rate, whatever the last bits of their times."""

LARGEST_TIME_ERROR = 0.05
"""How far a point may lie from an even time grid, part of the step [-]. Our choice: above what
rounding to the printed digits makes of even steps, far below a point that is missing."""


@dataclass(frozen=True)
class TraceFormat:
    """What the columns of a file mean.

    Attributes
    ----------
    columns : sequence of str or None
        Role of each column, see `ROLES`; None: `DEFAULT_ROLES` by their number.
    sampling_rate : float or None
        For files without a time column [Hz].
    hammer_scale, specimen_scale : float
        Acceleration per unit of the column [m/s^2]; see `find_scale`.
    hammer_full_scale, specimen_full_scale : float
        Largest acceleration the channel can show, either sign [m/s^2]; 0: not known.
    """

    columns: Sequence[str] | None = None
    sampling_rate: float | None = None
    hammer_scale: float = 1.0
    specimen_scale: float = 1.0
    hammer_full_scale: float = 0.0
    specimen_full_scale: float = 0.0

    def __post_init__(self) -> None:
        """Refuse roles that contradict each other and impossible numbers."""
        if self.sampling_rate is not None:
            check_positive("sampling rate", self.sampling_rate, "Hz")
        for name in ("hammer", "specimen"):
            scale = getattr(self, f"{name}_scale")
            if not (np.isfinite(scale) and scale != 0):
                raise ParameterError(f"{name} scale is {scale!r}: it must not be zero")
            check_not_negative(f"{name} full scale", getattr(self, f"{name}_full_scale"), "m/s^2")
        if self.columns is not None:
            self._check_columns(tuple(self.columns))

    def _check_columns(self, columns: tuple[str, ...]) -> None:
        for role in columns:
            if role not in ROLES:
                raise ParameterError(f"column role {role!r} is unknown: it is {', '.join(ROLES)}")
            if role != "skip" and columns.count(role) > 1:
                raise ParameterError(f"column role {role!r} is given twice")
        if "hammer" not in columns:
            raise ParameterError("no column has the role 'hammer': its pulse is what is measured")
        if ("time" in columns) == (self.sampling_rate is not None):
            raise ParameterError(
                "the sampling rate comes from a time column or is given: one of the two"
            )


def find_scale(unit: str, mass: float | None = None) -> float:
    """Return the acceleration that one unit of a channel stands for.

    Parameters
    ----------
    unit : str
        "m/s^2", "g", or "N" of a force hammer.
    mass : float, optional
        Of the hammer [kg]: a force is its mass times its acceleration.

    Returns
    -------
    float
        [m/s^2 per unit]

    Raises
    ------
    ParameterError
        If the unit is unknown, or a force has no mass.
    """
    if unit == "N":
        if mass is None:
            raise ParameterError("a channel in N needs the hammer's mass: acceleration is F/m")
        check_positive("hammer mass", mass, "kg")
        return 1.0 / mass
    scales = {"m/s^2": 1.0, "g": STANDARD_GRAVITY}
    if unit not in scales:
        raise ParameterError(f"unit {unit!r} is unknown: a channel is in m/s^2, g or N")
    return scales[unit]


def read_trace(path: Path, label: HitLabel, layout: TraceFormat | None = None) -> Record:
    """Read one hit from a file of columns.

    Parameters
    ----------
    path : Path
        `.npy` or delimited text, see `impact_rig.recording.tables.read_table`.
    label : HitLabel
        Which hit it is.
    layout : TraceFormat, optional
        What the columns mean.

    Returns
    -------
    Record
        Its `pulse_index` is None: finding the pulse is the caller's.

    Raises
    ------
    FileError
        If the file cannot be read as columns of numbers.
    SignalError
        If the columns do not fit their roles, are too short or not finite, or time does not run
        in even steps.
    """
    layout = layout or TraceFormat()
    path = Path(path)
    table = read_table(path)
    if table.shape[1] < MINIMUM_POINTS:
        raise SignalError(
            f"{path} has {table.shape[1]} points: a trace needs at least {MINIMUM_POINTS}"
        )
    columns = dict(zip(_find_roles(path, table.shape[0], layout), table, strict=True))
    for role in ROLES[:-1]:
        _check_finite(path, role, columns.get(role))
    rate = layout.sampling_rate
    if rate is None:
        rate = _find_sampling_rate(path, columns["time"])
    specimen = columns.get("specimen")
    return Record(
        label=label,
        sampling_rate=rate,
        hammer=Trace(layout.hammer_scale * columns["hammer"], layout.hammer_full_scale),
        specimen=None
        if specimen is None
        else Trace(layout.specimen_scale * specimen, layout.specimen_full_scale),
        pulse_index=None,
    )


def _find_roles(path: Path, count: int, layout: TraceFormat) -> tuple[str, ...]:
    if layout.columns is not None:
        if len(layout.columns) != count:
            raise SignalError(
                f"{path} has {count} columns, but {len(layout.columns)} roles are given:"
                f" {', '.join(layout.columns)}"
            )
        return tuple(layout.columns)
    if layout.sampling_rate is not None:
        defaults = DEFAULT_ROLES_WITHOUT_TIME
    elif count == 1:
        raise SignalError(f"{path} has one column and no time: give its sampling rate")
    else:
        defaults = DEFAULT_ROLES
    if count not in defaults:
        raise SignalError(
            f"{path} has {count} columns: give the role of each ({', '.join(ROLES)})"
        )
    return defaults[count]


def _check_finite(path: Path, role: str, values: FloatArray | None) -> None:
    if values is None:
        return
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise SignalError(
            f"{path}: {role} is {values[bad[0]]} at point {bad[0]} ({bad.size} such points): every"
            " point must be a finite number"
        )


def _find_sampling_rate(path: Path, time: FloatArray) -> float:
    step = (time[-1] - time[0]) / (time.size - 1)
    steps = np.diff(time)
    if not (step > 0 and np.isfinite(step)) or steps.min() <= 0:
        worst = int(np.argmin(steps))
        raise SignalError(
            f"{path}: time does not grow from point {worst} to {worst + 1}"
            f" ({time[worst]:g} s, {time[worst + 1]:g} s): is this the time column?"
        )
    deviation = np.abs(time - (time[0] + step * np.arange(time.size)))
    if deviation.max() > LARGEST_TIME_ERROR * step:
        worst = int(np.argmax(np.abs(steps - step)))
        raise SignalError(
            f"{path}: time does not run in even steps of {step:g} s: it goes on by"
            f" {steps[worst]:g} s at point {worst}"
        )
    return float(f"{1.0 / step:.{RATE_DIGITS}g}")
