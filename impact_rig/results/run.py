"""A campaign with the traces behind its results, and with its provenance for a report."""

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


@dataclass(frozen=True)
class Provenance:
    """When, by what and how a run was recorded."""

    start_time: int  # of the first message [ns since the epoch]; 0: there is none
    end_time: int  # of the last message [ns since the epoch]; 0: there is none
    size: int  # of the file [byte]
    sha256: str  # of its content
    problems: tuple[str, ...] = ()  # what is damaged or missing; empty: every checksum is right
    losses: str = ""  # what was lost while it was recorded; empty: nothing
    ended: str = ""  # why the recording ended, by the recorder
    versions: tuple[tuple[str, str], ...] = ()  # of software and libraries
    parameters: tuple[tuple[str, str], ...] = ()  # of every node, as YAML
    # What an operator said, and when [ns since the epoch]; 0: before the recording.
    notes: tuple[tuple[int, str], ...] = ()


@dataclass(frozen=True)
class Run:
    """One campaign of a report."""

    name: str  # unique in the report
    source: str  # file or folder it was read from, with its folder's name
    campaign: TracedCampaign
    provenance: Provenance | None = None  # None: results alone
    warnings: tuple[str, ...] = ()  # about the file
