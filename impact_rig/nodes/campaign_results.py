"""The results.json of a campaign, written at its end beside its recording for any client."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from impact_rig.configuration.processes import RESULTS_NAME
from impact_rig.core.given.errors import RigError
from impact_rig.core.given.records import SIMULATED
from impact_rig.nodes.identity import id_from_msg
from impact_rig.nodes.intake import Received
from impact_rig.recordings.messages import (
    VIRTUAL_IMPACT_TYPE,
    RecordedTruth,
    campaign_id_from_msg,
    truth_from_msg,
)
from impact_rig.recordings.run import Run

Faults = dict[int, tuple[str, ...]]
"""What the virtual rig did on purpose, by record."""


def read_faults(run: Run, campaign_id: bytes) -> Faults:
    """Return what the virtual rig did on purpose to the hits of a campaign."""
    found = (
        run.convert(raw, truth_from_msg)
        for raw in run.read_messages({VIRTUAL_IMPACT_TYPE})
        if run.convert(raw, campaign_id_from_msg) == campaign_id
    )
    return {label.record: truth.faults for label, truth in found}


class ResultsWriter:
    """Writes the results of a campaign by a thread of its own: a disk holds up no node.

    `report` gets the sentence if they cannot be written.
    """

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        self._faults: Faults = {}
        self._thread = ThreadPoolExecutor(1)

    def begin(self) -> None:
        """Forget the hits of the campaign before."""
        self._faults.clear()

    def on_truth(self, received: Received[RecordedTruth]) -> None:
        """Keep what the virtual rig did on purpose to a hit."""
        label, truth = received.value
        self._faults[label.record] = truth.faults

    def write(self, found: Any, recording: str) -> "Future[Faults]":
        """Write what the estimator has found, if the recording is on this computer.

        Return what the virtual rig did on purpose, also before a campaign was resumed.
        """
        return self._thread.submit(self._write, found, recording, {**self._faults})

    def _write(self, found: Any, recording: str, faults: Faults) -> Faults:
        # Who only runs campaigns waits for no physics to be loaded.
        from impact_rig.nodes.result_messages import results_from_msg
        from impact_rig.results.results_file import write_results

        try:
            folder, hits = Path(recording).parent, (*found.accepted, *found.rejected)
            if not (recording and folder.is_dir() and hits):
                return faults
            simulated = [hit.record for hit in hits if hit.origin.kind == SIMULATED]
            if any(record not in faults for record in simulated):  # struck before it was resumed
                faults = read_faults(Run(folder), id_from_msg(found.setup.campaign_id)) | faults
            write_results(folder / RESULTS_NAME, results_from_msg(found, faults))
        except (RigError, OSError) as error:
            self._report(str(error))
        return faults

    def close(self) -> None:
        """End when what was asked for is written."""
        self._thread.shutdown()
