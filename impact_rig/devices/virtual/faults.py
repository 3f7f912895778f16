"""What goes wrong on a real rig, on request: per hit, or by probability."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from impact_rig.core.checks import check_between
from impact_rig.core.errors import ParameterError
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.choices import Fault


def fault_from_name(name: str) -> Fault:
    """Return the fault called `name`; raises `ParameterError` for an unknown one."""
    try:
        return Fault(name)
    except ValueError:
        known = ", ".join(fault.value for fault in Fault)
        raise ParameterError(f"unknown fault {name!r}: the virtual rig knows {known}") from None


@dataclass(frozen=True)
class ScheduledFault:
    """A fault ordered for one hit, at its first attempt.

    Attributes
    ----------
    fault : Fault
        What.
    impact : int
        Impact of the series, counted from 1.
    sample : str
        Name of the sample; empty: every sample.
    """

    fault: Fault
    impact: int
    sample: str = ""

    def __post_init__(self) -> None:
        """Refuse an impossible impact number."""
        check_between("impact number of a fault", self.impact, 1, 1_000_000)


def scheduled_fault_from_text(text: str) -> ScheduledFault:
    """Read ``3:double_hit`` or ``steel small/3:double_hit``.

    Raises
    ------
    ParameterError
        If the text has another form, or the fault is unknown.
    """
    place, colon, name = text.rpartition(":")
    sample, _, impact = place.rpartition("/")
    if not colon or not impact.isdecimal():
        raise ParameterError(
            f"scheduled fault {text!r}: write IMPACT:FAULT or SAMPLE/IMPACT:FAULT, for example"
            " 3:double_hit"
        )
    return ScheduledFault(fault_from_name(name), int(impact), sample)


@dataclass(frozen=True)
class FaultPlan:
    """When which fault is injected.

    Attributes
    ----------
    probability : float
        Of each of `faults`, drawn for each hit on its own [-].
    faults : tuple of Fault
        Those that are drawn.
    scheduled : tuple of ScheduledFault
        Those ordered for one hit.
    """

    probability: float = 0.0
    faults: tuple[Fault, ...] = tuple(Fault)
    scheduled: tuple[ScheduledFault, ...] = field(default_factory=tuple)

    def __post_init__(self) -> None:
        """Refuse a probability that is none."""
        check_between("fault probability", self.probability, 0.0, 1.0)

    def draw(self, label: HitLabel, generator: np.random.Generator) -> tuple[Fault, ...]:
        """Return the faults of one hit; takes the same number of draws whatever comes."""
        drawn = generator.random(len(Fault))
        chosen = {
            fault
            for fault, value in zip(Fault, drawn, strict=True)
            if fault in self.faults and value < self.probability
        }
        chosen.update(
            item.fault
            for item in self.scheduled
            if item.impact == label.impact
            and label.attempt == 1
            and item.sample in ("", label.sample)
        )
        return tuple(fault for fault in Fault if fault in chosen)


def faults_from_names(names: Iterable[str]) -> tuple[Fault, ...]:
    """Return faults by name; no names: all of them."""
    return tuple(fault_from_name(name) for name in names) or tuple(Fault)
