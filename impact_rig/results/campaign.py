"""What a campaign found, flat: set-up, every hit, and what was estimated from them.

The field names are those of results.json. Nothing in here depends on when, where or with which
libraries the numbers were found: the same hits give the same results, character by character.
"""

from dataclasses import dataclass

from impact_rig.results.estimates import NAN, HammerResults, SampleResults
from impact_rig.results.setup_results import SetupResults


@dataclass(frozen=True)
class HitResults:
    """One hit with the last word on it.

    Attributes
    ----------
    sample : str
        Name of the struck sample.
    impact, attempt, record : int
        Impact of the series, attempt at it, number of the arming; counted from 1.
    accepted : bool
        The hit is part of the sample's mean.
    reasons : tuple of str
        Every reason against it, ``code: explanation``.
    contact_time_s : float
        tau_p of this hit alone [s]; NaN: not determined.
    hammer_peak_m_per_s2, specimen_peak_m_per_s2 : float
        Largest |acceleration| after the low-pass [m/s^2]; NaN: no pulse, or not measured.
    injected_faults : tuple of str
        What the virtual rig did on purpose, by name; empty: nothing, or a real rig.
    """

    sample: str
    impact: int
    attempt: int
    record: int
    accepted: bool = False
    reasons: tuple[str, ...] = ()
    contact_time_s: float = NAN
    hammer_peak_m_per_s2: float = NAN
    specimen_peak_m_per_s2: float = NAN
    injected_faults: tuple[str, ...] = ()


@dataclass(frozen=True)
class Results:
    """Everything that a campaign or the analysis of its recording found.

    Attributes
    ----------
    setup : SetupResults
        With what was measured.
    hammer : HammerResults
        k1, c1.
    samples : tuple of SampleResults
        Those with hits, in the order of the sample set.
    hits : tuple of HitResults
        All, by record.
    """

    setup: SetupResults
    hammer: HammerResults
    samples: tuple[SampleResults, ...]
    hits: tuple[HitResults, ...]

    @property
    def rejections(self) -> tuple[HitResults, ...]:
        """Hits that are in no mean, by record."""
        return tuple(hit for hit in self.hits if not hit.accepted)

    def find_accepted(self, sample: str) -> tuple[HitResults, ...]:
        """Return the hits in the mean of one sample, by record."""
        return tuple(hit for hit in self.hits if hit.accepted and hit.sample == sample)
