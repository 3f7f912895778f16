"""What is logged into a Rerun recording: hits, verdicts, samples, results, health."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.hit_traces import HitTraces
from impact_rig.results.palette import HAMMER, SPECIMEN
from impact_rig.results.sample_traces import AlignedHit, SampleTraces
from impact_rig.results.traced_campaign import TracedCampaign
from impact_rig.visualization import entities
from impact_rig.visualization.blueprint import make_blueprint
from impact_rig.visualization.entities import Path
from impact_rig.visualization.health import Health
from impact_rig.visualization.plots import Line, PlotLog
from impact_rig.visualization.rerun_sdk import import_rerun
from impact_rig.visualization.sample_plots import draw_aligned_hits, draw_sample
from impact_rig.visualization.tables import write_health, write_results
from impact_rig.visualization.text import write_log_line, write_verdict

if TYPE_CHECKING:
    import rerun as rr

HIT_WIDTH = 1.5
"""Line width of the last hit [points]."""


class ViewLog:
    """Logs a campaign into one Rerun recording.

    Parameters
    ----------
    stream : rerun.RecordingStream
        Where to; its sinks are the caller's.

    Raises
    ------
    RigError
        If rerun-sdk is not installed.
    """

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._rr = import_rerun()
        self._stream = stream
        self._plots = PlotLog(stream)
        self._sample_names: tuple[str, ...] | None = None

    def log_setup(self, name: str, sample_names: Sequence[str]) -> None:
        """Begin a campaign: hide what was shown before, lay the view out for a sample set.

        With the same samples as before the layout is left as the user has arranged it.

        Parameters
        ----------
        name : str
            Of the rig; the recording is called by it. Empty: not known.
        sample_names : sequence of str
            In their order.
        """
        self._plots.hide(())
        if name:
            self._stream.send_recording_name(name)
        if self._sample_names != tuple(sample_names):
            self._sample_names = tuple(sample_names)
            self._stream.send_blueprint(make_blueprint(sample_names))

    def log_hit(self, traces: HitTraces) -> None:
        """Show a record's traces in place of the last one's; an empty record shows nothing."""
        self._plots.hide(entities.HITS)
        label = traces.label
        lines = [Line("hammer", HAMMER, HIT_WIDTH), Line("sample", SPECIMEN, HIT_WIDTH)]
        path = self._plots.draw_lines(entities.HITS, traces.time, traces.values, lines)
        self._stream.log(
            path,
            self._rr.AnyValues(
                sample=label.sample,
                record=label.record,
                impact=label.impact,
                attempt=label.attempt,
            ),
            static=True,
        )

    def log_verdict(self, verdict: HitResults, stamp: int) -> None:
        """Show a hit's verdict, and add it to the log.

        Parameters
        ----------
        verdict : HitResults
            On the hit.
        stamp : int
            Time of the hit, nanoseconds since the epoch.
        """
        self._log_document(entities.VERDICT, write_verdict(verdict))
        level = self._rr.TextLogLevel.INFO if verdict.accepted else self._rr.TextLogLevel.WARN
        rr = self._rr
        self._stream.send_columns(
            rr.new_entity_path(entities.LOG),
            indexes=[
                rr.TimeColumn(entities.HIT, sequence=[verdict.record]),
                rr.TimeColumn(entities.WALL_CLOCK, timestamp=np.array([stamp], "datetime64[ns]")),
                # A line is shown only where the timeline of the plots has it, too.
                rr.TimeColumn(entities.HIT_TIME, duration=np.zeros(1, "timedelta64[ns]")),
            ],
            columns=rr.TextLog.columns(text=[write_log_line(verdict)], level=[level]),
        )

    def log_aligned_hit(self, hit: AlignedHit) -> None:
        """Lay a hit over the others of its sample; for hits in the mean."""
        draw_aligned_hits(self._plots, [hit])

    def log_sample(self, traces: SampleTraces) -> None:
        """Show a sample's mean, models, residuals and marks in place of the ones before."""
        draw_sample(self._plots, traces)

    def log_results(self, results: Results) -> None:
        """Show tables and figures in place of the ones before."""
        self._log_document(entities.TABLES, write_results(results))

    def log_health(self, health: Health) -> None:
        """Show what the nodes say of themselves, and add their figures to the history."""
        self._log_document(entities.HEALTH, write_health(health))

    def log_campaign(self, campaign: TracedCampaign) -> None:
        """Show a campaign with everything there is to see of it, all at once."""
        setup = campaign.results.setup
        self.log_setup(setup.name, [sample.name for sample in setup.samples])
        overlays: dict[str, list[AlignedHit]] = defaultdict(list)
        for hit in campaign.hits:
            self.log_hit(hit.recorded)
            self.log_verdict(hit.result, hit.stamp)
            if hit.aligned is not None and hit.result.accepted:
                overlays[hit.result.sample].append(hit.aligned)
        for hits in overlays.values():
            draw_aligned_hits(self._plots, hits)
        for traces in campaign.samples:
            self.log_sample(traces)
        self.log_results(campaign.results)

    def _log_document(self, path: Path, text: str) -> None:
        document = self._rr.TextDocument(text, media_type=self._rr.MediaType.MARKDOWN)
        # Static: to be seen wherever the time cursor stands.
        self._stream.log(self._rr.new_entity_path(path), document, static=True)
