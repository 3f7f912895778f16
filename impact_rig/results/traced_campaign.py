"""A campaign with everything there is to see of it: results, and the traces behind them."""

from dataclasses import dataclass

from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.hit_traces import HitTraces
from impact_rig.results.sample_traces import AlignedHit, SampleTraces


@dataclass(frozen=True)
class TracedHit:
    """One hit with its traces.

    Attributes
    ----------
    result : HitResults
        The last word on it.
    stamp : int
        Time of the record's first point, nanoseconds since the epoch.
    recorded : HitTraces
        As the accelerometers gave it.
    aligned : AlignedHit or None
        Filtered, in its sample's time; None: it has no whole pulse.
    """

    result: HitResults
    stamp: int
    recorded: HitTraces
    aligned: AlignedHit | None


@dataclass(frozen=True)
class TracedCampaign:
    """One campaign with everything there is to see.

    Attributes
    ----------
    results : Results
        What was found.
    samples : tuple of SampleTraces
        Those with a mean hit, in the order of the results; empty without traces.
    hits : tuple of TracedHit
        All, in the order of arrival; empty without traces.
    """

    results: Results
    samples: tuple[SampleTraces, ...] = ()
    hits: tuple[TracedHit, ...] = ()
