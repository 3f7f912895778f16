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
    """What a recording says of itself beside the hits.

    Attributes
    ----------
    start_time, end_time : int
        Of its messages, nanoseconds since the epoch; 0: it has none.
    files : tuple of RecordedFile
        In their order.
    problems : tuple of str
        What is damaged or missing; empty: every checksum is right.
    losses : str
        What was lost while it was recorded; empty: nothing.
    ended : str
        Why the recording ended, as the recorder has it.
    versions : tuple of (str, str)
        Software and libraries that recorded it.
    parameters : tuple of (str, str)
        Of every node, as YAML.
    notes : tuple of Note
        The operator's.
    """

    start_time: int
    end_time: int
    files: tuple[RecordedFile, ...]
    problems: tuple[str, ...] = ()
    losses: str = ""
    ended: str = ""
    versions: tuple[tuple[str, str], ...] = ()
    parameters: tuple[tuple[str, str], ...] = ()
    notes: tuple[Note, ...] = ()


@dataclass(frozen=True)
class Run:
    """One campaign of a report.

    Attributes
    ----------
    name : str
        Tells it from the other runs of the report.
    source : str
        File or folder it was read from, with its folder's name.
    campaign : TracedCampaign
        Results, and the traces where there are any.
    has_traces : bool
        It was read from a recording, not from results alone.
    acquisitions : tuple of Acquisition
        Each way in which hits were sampled, by first use; empty: not known.
    provenance : Provenance or None
        None: results alone do not say.
    warnings : tuple of str
        What the reader should know of the file.
    """

    name: str
    source: str
    campaign: TracedCampaign
    has_traces: bool = False
    acquisitions: tuple[Acquisition, ...] = ()
    provenance: Provenance | None = None
    warnings: tuple[str, ...] = ()
