"""A campaign with the traces behind its results."""

from dataclasses import dataclass

from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.hit_traces import HitTraces
from impact_rig.results.sample_traces import AlignedHit, SampleTraces


@dataclass(frozen=True)
class TracedHit:
    """One hit with its traces."""

    result: HitResults
    stamp: int  # of the record's first point [ns since the epoch]
    recorded: HitTraces
    aligned: AlignedHit | None  # filtered, in its sample's time; None: it has no whole pulse


@dataclass(frozen=True)
class TracedCampaign:
    """One campaign with its traces."""

    results: Results
    samples: tuple[SampleTraces, ...] = ()  # those with a mean hit; empty without traces
    hits: tuple[TracedHit, ...] = ()  # all, in the order of arrival; empty without traces
