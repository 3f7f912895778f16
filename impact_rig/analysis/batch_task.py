"""One recording of many: what is sent to a process that analyzes it, and what comes back."""

from dataclasses import dataclass
from pathlib import Path

from impact_rig.analysis.recording_analysis import (
    AnalyzedRecording,
    Settings,
    analyze_recording,
)
from impact_rig.core.errors import RigError


@dataclass(frozen=True)
class BatchOutcome:
    """What came of one recording of many.

    Attributes
    ----------
    path : Path
        As it was given.
    recording : AnalyzedRecording or None
        None: it could not be analyzed.
    error : str
        Why not.
    """

    path: Path
    recording: AnalyzedRecording | None
    error: str = ""


@dataclass(frozen=True, eq=False)
class BatchTask:
    """What a worker is sent: paths and settings, no data.

    Attributes
    ----------
    path : Path
        Of the recording.
    settings : mapping
        Fields of `AnalysisSettings` to use in place of the recorded ones.
    """

    path: Path
    settings: Settings

    def run(self) -> BatchOutcome:
        """Analyze the recording; what is wrong with it is an outcome too."""
        try:
            return BatchOutcome(self.path, analyze_recording(self.path, self.settings))
        except RigError as error:
            return BatchOutcome(self.path, None, str(error))
        except MemoryError:
            return BatchOutcome(self.path, None, f"{self.path} needs more memory than there is")
