"""Recordings through the core: the same numbers as in the live run, bit by bit."""

from dataclasses import dataclass, replace
from pathlib import Path

from impact_rig.cli.settings_changes import SettingsChanges
from impact_rig.core.errors import FileError
from impact_rig.core.session import Session
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import Block
from impact_rig.recording.mcap_reader import Recording, read_recording
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


def analyze_recording(path: Path, changes: SettingsChanges) -> AnalyzedRecording:
    """Judge every hit of a recording and estimate, as the estimator does live.

    Parameters
    ----------
    path : Path
        Of the `.mcap` file.
    changes : SettingsChanges
        Settings to use in place of the recorded ones.

    Raises
    ------
    FileError
        If the file is no recording of a rig, or holds no hit.
    ParameterError
        If the settings cannot be used.
    """
    recording = read_recording(path)
    campaigns = []
    session: Session | None = None
    for event in recording.events():
        if not isinstance(event, Block):
            # Each campaign begins with its set-up, and its estimates start afresh.
            campaigns += _finish(session, recording)
            session = Session(replace(event, analysis=changes.apply(event.analysis)))
        elif session is not None:
            session.feed(event)
    campaigns += _finish(session, recording)
    if not campaigns:
        raise FileError(f"{path} holds no hit: no block of it completes a record")
    return AnalyzedRecording(path, tuple(campaigns), recording.warnings)


def _finish(session: Session | None, recording: Recording) -> list[AnalyzedCampaign]:
    if session is None or not session.names:
        return []
    faults = {label.record: names for label, names in recording.faults.items()}
    results = results_from_session(session.estimate_all(), faults)
    return [AnalyzedCampaign(session.setup, results)]
