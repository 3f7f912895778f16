"""Sampling rates and steps that a file states by a name, in the words and units of any program."""

import math

from impact_rig.files.names import WORD, split_name
from impact_rig.files.times import TIME_UNITS, normalize_time_unit, round_rate

RATE_NAMES = {"fs", "rate", "samplerate", "samplefrequency", "abtastrate"}
RATE_WORDS = {"sampling", "sample", "samples", "acquisition", "scan"}
FREQUENCY_WORDS = {"rate", "frequency", "freq"}
"""A name of a rate is one of the first, or has a word of each of the others."""
STEP_NAMES = {
    "dt", "delta t", "delta x", "step", "ts", "sample interval", "sampling interval", "increment",
    "sample period", "sampling period", "time interval", "tinc", "tinterval",
}  # fmt: skip
PREFIXES = {"": 1.0, "k": 1e3, "m": 1e6, "g": 1e9}
FREQUENCIES = {
    prefix + unit: factor
    for prefix, factor in PREFIXES.items()
    for unit in ("hz", "s/s", "sa/s", "sps", "samples/s")
}
"""In small letters [Hz]; no rate is in thousandths, so m is mega."""


def clean_heading(name: str) -> tuple[str, str]:
    """Return a name in small letters, underscores as blanks, and the unit in its brackets."""
    bare, unit = split_name(name.strip())
    bare = bare.replace("_", " ").strip().lower()
    last = bare.rpartition(" ")
    return (last[0], last[2]) if last[0] and not unit and last[2] in FREQUENCIES else (bare, unit)


def is_rate_name(name: str) -> bool:
    """Return whether a name is that of a sampling rate, as `Fs` or `Sampling Frequency (Hz)`."""
    bare, _ = clean_heading(name)
    words = set(WORD.findall(bare))
    return bare in RATE_NAMES or bool(words & RATE_WORDS and words & FREQUENCY_WORDS)


def is_step_name(name: str) -> bool:
    """Return whether a name is that of the time between two points, as `dt` or `Delta X`."""
    return clean_heading(name)[0] in STEP_NAMES


def compute_stated_rate(name: str, value: float, unit: str = "") -> float:
    """Return the rate that a number states by its name [Hz]; NaN: it states none.

    Parameters
    ----------
    name : str
        As in the file; it may have the unit in brackets.
    value : float
        Of the rate, or of the step.
    unit : str
        Beside the value; empty: that of the name, else Hz or s.
    """
    unit = unit or clean_heading(name)[1]
    if is_rate_name(name):
        rate = value * FREQUENCIES.get(unit.lower(), math.nan if unit else 1.0)
        return rate if math.isfinite(rate) and rate > 0.0 else math.nan
    if not is_step_name(name):
        return math.nan
    scale = TIME_UNITS.get(normalize_time_unit(unit), math.nan if unit else 1.0)
    return round_rate(scale * value)


def states_unit(name: str, unit: str = "") -> bool:
    """Return whether a rate or step has a unit; a step without one may be in any."""
    return is_rate_name(name) or bool(unit or clean_heading(name)[1])
