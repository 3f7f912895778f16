"""What a check of the installation found."""

from dataclasses import dataclass
from enum import Enum


class Status(Enum):
    """How good a finding is."""

    OK = "ok"
    WARNING = "warning"
    FAULT = "fault"


@dataclass(frozen=True)
class Finding:
    """One line of the doctor's report.

    Attributes
    ----------
    name : str
        What was looked at.
    status : Status
        A fault is what keeps the rig from working.
    text : str
        What was found.
    advice : str
        What to do about it; empty where all is well.
    """

    name: str
    status: Status
    text: str
    advice: str = ""
