"""One campaign with its provenance, as a report needs it."""

from dataclasses import dataclass

from impact_rig.results.hit_traces import Acquisition
from impact_rig.results.traced_campaign import TracedCampaign


@dataclass(frozen=True)
class RecordedFile:
    """One file of a recording: name, size [byte] and the SHA-256 of its content."""

    name: str
    size: int
    sha256: str


@dataclass(frozen=True)
class Note:
    """What an operator said, and when [ns since the epoch]; 0: before the recording."""

    time: int
    text: str


@dataclass(frozen=True)
class Provenance:
    """When, by what and how a run was recorded."""

    start_time: int  # of the first message [ns since the epoch]; 0: there is none
    end_time: int  # of the last message [ns since the epoch]; 0: there is none
    files: tuple[RecordedFile, ...]
    problems: tuple[str, ...] = ()  # what is damaged or missing; empty: every checksum is right
    losses: str = ""  # what was lost while it was recorded; empty: nothing
    ended: str = ""  # why the recording ended, by the recorder
    versions: tuple[tuple[str, str], ...] = ()  # of software and libraries
    parameters: tuple[tuple[str, str], ...] = ()  # of every node, as YAML
    notes: tuple[Note, ...] = ()  # the operator's


@dataclass(frozen=True)
class Run:
    """One campaign of a report."""

    name: str  # unique in the report
    source: str  # file or folder it was read from, with its folder's name
    campaign: TracedCampaign
    has_traces: bool = False  # it was read from a recording, not from results alone
    acquisitions: tuple[Acquisition, ...] = ()  # in the order of their first use
    provenance: Provenance | None = None  # None: results alone
    warnings: tuple[str, ...] = ()  # about the file
