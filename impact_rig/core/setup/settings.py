"""How hits are cut out, judged and evaluated: one record, stored with every recording."""

from dataclasses import dataclass, field

from impact_rig.core.checks import check_between, check_not_negative, check_positive
from impact_rig.core.errors import ParameterError
from impact_rig.core.quantity import describe

CONTACT_EXPONENTS = (0.6, 3.9)
"""Least and largest n of a contact law that is given [-], our choice: 1 is a linear spring, 3/2
Hertz; the family ends a little beyond."""
MOST_KEPT_HITS = 1_000_000
"""Largest `keep_hits` [-], our choice: more than any campaign strikes."""


@dataclass(frozen=True)
class AnalysisSettings:
    """Settings of detection, verdict and estimation.

    Attributes
    ----------
    cutoff_frequency : float
        -3 dB frequency of the zero-phase low-pass [Hz]; 0 switches it off. 50 kHz as published.
    pulse_factor : float
        F in tau_p = F * w50 [-]; the published 2 belongs to a versed-sine.
    pre_trigger : float
        Kept before the impact, and the source of the baseline [s]. Our choice: a tenth of the
        record.
    record_duration : float
        Length of a hit's record [s]; 2 ms as published.
    detection_level : float
        Hammer acceleration that starts a hit, part of full scale [-]. Our choice: well above
        12-bit noise, well below the weakest acceptable hit.
    minimum_peak : float
        Weakest acceptable hammer peak, part of full scale [-]. Our choice.
    maximum_peak : float
        Strongest acceptable peak of either channel, part of full scale [-]. Our choice: room for
        offset and noise below the rail.
    overload_run : int
        Points in a row at the rail that make an overload [-]. Our choice: one point may be
        chance, two are not.
    double_hit_level : float
        Second pulse that makes a double hit, part of the first [-]. Our choice: noise and what
        sensors leave behind are less.
    keep_hits : int
        How many accepted hits of a sample are averaged at most, the most consistent ones [-]; 0:
        all.
    double_hit_window : float
        Distance of two pulses up to which the second counts [s]; 0: any.
    turns_polarity : bool
        Turn hits of the other sign than those before, instead of rejecting them.
    contact_exponent : float
        n of the contact law where it is known [-]; 0: it is fitted.
    """

    cutoff_frequency: float = field(default=50e3, metadata=describe("Hz"))
    pulse_factor: float = 2.0
    pre_trigger: float = field(default=0.2e-3, metadata=describe("s"))
    record_duration: float = field(default=2e-3, metadata=describe("s"))
    detection_level: float = 0.03
    minimum_peak: float = 0.15
    maximum_peak: float = 0.95
    overload_run: int = 2
    double_hit_level: float = 0.02
    keep_hits: int = 0
    double_hit_window: float = field(default=0.0, metadata=describe("s", since=6))
    turns_polarity: bool = field(default=False, metadata=describe(since=6))
    contact_exponent: float = field(default=0.0, metadata=describe(since=6))

    def __post_init__(self) -> None:
        """Refuse values that cannot be meant."""
        check_not_negative("cutoff_frequency", self.cutoff_frequency, "Hz")
        check_between("pulse_factor", self.pulse_factor, 1.0, 4.0)
        check_positive("pre_trigger", self.pre_trigger, "s")
        check_positive("record_duration", self.record_duration, "s")
        if self.pre_trigger >= self.record_duration:
            raise ParameterError(
                f"pre_trigger is {self.pre_trigger} s: it must be shorter than the record"
                f" of {self.record_duration} s"
            )
        check_between("detection_level", self.detection_level, 1e-6, 1.0)
        check_between("minimum_peak", self.minimum_peak, 0.0, 1.0)
        check_between("maximum_peak", self.maximum_peak, 0.0, 1.0)
        if self.maximum_peak <= self.minimum_peak:
            raise ParameterError(
                f"maximum_peak is {self.maximum_peak!r}: it must lie above the minimum_peak of"
                f" {self.minimum_peak!r}"
            )
        check_between("overload_run", self.overload_run, 1, 1000)
        check_between("double_hit_level", self.double_hit_level, 1e-3, 1.0)
        check_not_negative("double_hit_window", self.double_hit_window, "s")
        if self.contact_exponent:
            check_between("contact_exponent", self.contact_exponent, *CONTACT_EXPONENTS)
        check_between("keep_hits", self.keep_hits, 0, MOST_KEPT_HITS)
        if self.keep_hits != int(self.keep_hits):
            raise ParameterError(f"keep_hits is {self.keep_hits!r}: it must be whole")
