"""Unit, quantity and body of a channel, from its name."""

import re
from enum import Enum

from impact_rig.core.given.sensors import ACCELERATIONS, FORCES, UNITS, normalize_unit
from impact_rig.files.times import TIME_UNITS, normalize_time_unit

BRACKETS = {"]": "[", ")": "("}
PARTS = re.compile(r"[/.]")
"""Separators between the parts of a name: groups in a file, or structs."""
CAPITAL = re.compile(r"(?<=[a-zäöü])(?=[A-ZÄÖÜ])")
WORD = re.compile(r"[^\W\d_]+")
"""Where a new word begins in `AccHammer1`, and the words themselves: `Acc`, `Hammer`."""
HAMMER_WORDS = {"tip", "excitation", "exc", "impactor", "striker", "anregung"}
"""Words for the hammer's channel, in small letters; so are all with `hammer` in them."""
SAMPLE_WORDS = {"specimen", "sample", "response", "resp", "target", "probe", "antwort"}
FORCE_WORDS = {"force", "kraft", "load", "loadcell", "f"}
ACCELERATION_WORDS = {
    "acc", "accel", "acceleration", "accelerometer", "accelerometers", "beschleunigung", "a",
}  # fmt: skip
OTHER_WORDS = {
    "temp", "temperature", "temperatur", "pressure", "druck", "displacement", "velocity",
    "position", "weg", "trigger", "trig", "tacho", "rpm", "status", "strain",
}  # fmt: skip
"""Words for channels of neither hammer nor sample."""


class Measured(Enum):
    """Quantity of a channel."""

    FORCE = "force"
    ACCELERATION = "acceleration"
    OTHER = "other"
    UNKNOWN = "unknown"


def is_unit(text: str) -> bool:
    """Return whether a text is a unit of a channel or of times."""
    return normalize_unit(text) in UNITS or normalize_time_unit(text) in TIME_UNITS


def split_name(cell: str) -> tuple[str, str]:
    """Return name and unit of `hammer [m/s^2]`, `hammer (m/s^2)`, `hammer / N` or `C1 in V`."""
    opening = BRACKETS.get(cell[-1:])
    if opening is None:
        for name, mark, unit in (cell.rpartition("/"), f" {cell}".rpartition(" in ")):
            if mark and is_unit(unit):
                return name.strip(), unit.strip()
        return cell, ""
    depth = 0
    for place in range(len(cell) - 1, -1, -1):
        depth += (cell[place] == cell[-1]) - (cell[place] == opening)
        if depth == 0:
            return cell[:place].strip(), cell[place + 1 : -1].strip()
    return cell, ""


def find_unit(name: str) -> str:
    """Return the unit that a name states, as `force (N)`, `acc / g`, or `force_N`; empty: none.

    A unit behind an underscore must suit the name: `acc_g` is in g, `input_g` may be the seventh.
    """
    bare, unit = split_name(name)
    if unit:
        return normalize_unit(unit) if normalize_unit(unit) in UNITS else ""
    head, _, tail = bare.partition("_")
    while tail:
        unit = normalize_unit(tail)
        of = FORCES if _find_kind(head) is Measured.FORCE else ACCELERATIONS
        if unit in of and (_find_kind(head) is not Measured.UNKNOWN or says_hammer(head)):
            return unit
        part, _, tail = tail.partition("_")
        head = f"{head}_{part}"
    return ""


def find_kind(name: str, unit: str) -> Measured:
    """Return a channel's quantity: by its unit, else by the words of its name."""
    if unit in FORCES:
        return Measured.FORCE
    if unit in ACCELERATIONS:
        return Measured.ACCELERATION
    return Measured.OTHER if unit and unit not in UNITS else _find_kind(split_name(name)[0])


def _find_kind(name: str) -> Measured:
    words = list_words(name)
    if words & OTHER_WORDS:
        return Measured.OTHER
    for kind, known in (
        (Measured.FORCE, FORCE_WORDS),
        (Measured.ACCELERATION, ACCELERATION_WORDS),
    ):
        # A single letter is a word where it is the whole name: `f`, not `channel f`.
        if any(word in known and (len(word) > 1 or len(words) == 1) for word in words):
            return kind
    return Measured.UNKNOWN


def says_hammer(name: str) -> bool:
    """Return whether a name says that the channel is the hammer's: `hammer1`, `Tip force`."""
    words = list_words(name)
    return bool(words & HAMMER_WORDS) or any("hammer" in word for word in words)


def says_sample(name: str) -> bool:
    """Return whether a name says that the channel is the sample's: `specimen`, `response 2`."""
    return bool(list_words(name) & SAMPLE_WORDS)


def list_words(name: str) -> set[str]:
    """Return the words of the last part of a name, in small letters, without digits."""
    last = PARTS.split(split_name(name)[0])[-1]
    return {word.lower() for word in WORD.findall(CAPITAL.sub(" ", last))}
