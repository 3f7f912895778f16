"""The results.json of a campaign, beside its recording, at its end: whoever began it."""

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

    Parameters
    ----------
    report : callable
        Gets the sentence if they cannot be written.
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

    def lacks_truth(self, found: Any) -> bool:
        """Return whether the truth behind some hits of the virtual rig is still on its way."""
        records = {hit.record for hit in (*found.accepted, *found.rejected)}
        return bool(self._faults) and not records <= self._faults.keys()

    def write(self, found: Any, recording: str) -> "Future[None]":
        """Write what the estimator has found, if the recording is on this computer."""
        return self._thread.submit(self._write, found, Path(recording).parent, {**self._faults})

    def _write(self, found: Any, folder: Path, faults: Faults) -> None:
        # Who only runs campaigns waits for no physics to be loaded.
        from impact_rig.nodes.result_messages import results_from_msg
        from impact_rig.results.results_file import write_results

        try:
            if not (folder.is_dir() and (found.accepted or found.rejected)):
                return
            hits = (*found.accepted, *found.rejected)
            simulated = [hit.record for hit in hits if hit.origin.kind == SIMULATED]
            if any(record not in faults for record in simulated):  # struck before it was resumed
                faults = read_faults(Run(folder), id_from_msg(found.setup.campaign_id)) | faults
            write_results(folder / RESULTS_NAME, results_from_msg(found, faults))
        except (RigError, OSError) as error:
            self._report(str(error))

    def close(self) -> None:
        """End when what was asked for is written."""
        self._thread.shutdown()
