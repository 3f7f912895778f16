"""Recordings through the core: the same numbers as in the live run, bit by bit."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from impact_rig.cli.analysis.settings_changes import SettingsChanges
from impact_rig.core.errors import FileError, ParameterError
from impact_rig.core.hits.overrule import describe_label, make_overrules
from impact_rig.core.session import Session
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import Block
from impact_rig.recording.reading.mcap_reader import Recording, read_recording
from impact_rig.reporting.flat_estimates import results_from_session
from impact_rig.reporting.results import Results


@dataclass(frozen=True)
class AnalyzedCampaign:
    """One campaign of a recording.

    Attributes
    ----------
    setup : RigSetup
        Masses, samples and the settings that were used.
    results : Results
        What was found.
    """

    setup: RigSetup
    results: Results


@dataclass(frozen=True)
class AnalyzedRecording:
    """What a recording holds.

    Attributes
    ----------
    path : Path
        Of the file.
    campaigns : tuple of AnalyzedCampaign
        Those with hits, in their order; at least one.
    warnings : tuple of str
        What the user should know of the file.
    """

    path: Path
    campaigns: tuple[AnalyzedCampaign, ...]
    warnings: tuple[str, ...]


def analyze_recording(
    path: Path,
    changes: SettingsChanges,
    accept: Sequence[str] = (),
    reject: Sequence[str] = (),
) -> AnalyzedRecording:
    """Judge every hit of a recording and estimate, as the estimator does live.

    Parameters
    ----------
    path : Path
        Of the `.mcap` file.
    changes : SettingsChanges
        Settings to use in place of the recorded ones.
    accept, reject : sequence of str
        Hits that a person takes into the mean or leaves out, by name; see `find_label`.

    Raises
    ------
    FileError
        If the file is no recording of a rig, or holds no hit.
    ParameterError
        If the settings cannot be used, or a person's word on a hit makes no sense.
    """
    recording = read_recording(path)
    sessions: list[Session] = []
    for event in recording.events():
        if not isinstance(event, Block):
            # Each campaign begins with its set-up, and its estimates start afresh.
            sessions.append(Session(replace(event, analysis=changes.apply(event.analysis))))
        elif sessions:
            sessions[-1].feed(event)
    sessions = [session for session in sessions if session.names]
    if not sessions:
        raise FileError(f"{path} holds no hit: no block of it completes a record")
    _overrule(sessions, accept, reject)
    campaigns = tuple(_finish(session, recording) for session in sessions)
    return AnalyzedRecording(path, campaigns, recording.warnings)


def _overrule(sessions: Sequence[Session], accept: Sequence[str], reject: Sequence[str]) -> None:
    if not (accept or reject):
        return
    counts = Counter(label for session in sessions for label in set(session.labels))
    overrules = make_overrules(accept, reject, list(counts))
    for label in overrules.accepted | overrules.rejected:
        if counts[label] > 1:
            raise ParameterError(
                f"hit {describe_label(label)} is in {counts[label]} campaigns of the recording:"
                " it cannot be told which one is meant"
            )
    for session in sessions:
        session.overrule(overrules)


def _finish(session: Session, recording: Recording) -> AnalyzedCampaign:
    faults = {label.record: names for label, names in recording.faults.items()}
    results = results_from_session(session.estimate_all(), faults)
    return AnalyzedCampaign(session.setup, results)
