"""Logs hits, verdicts, samples and results into a Rerun recording."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from impact_rig.core.estimates.contact_law import NO_LAW, ContactLaw
from impact_rig.core.given.setup import ACCELERATION, RigSetup
from impact_rig.present.rerun import entities
from impact_rig.present.rerun.blueprint import make_blueprint
from impact_rig.present.rerun.entities import BODIES, Path
from impact_rig.present.rerun.markdown import (
    format_log_line,
    format_results,
    format_summary,
    format_verdict,
)
from impact_rig.present.rerun.plots import (
    Look,
    PlotLog,
    draw_aligned_hits,
    draw_law,
    draw_sample,
    make_scalars,
)
from impact_rig.present.rerun.viewers import import_rerun
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.numbers import MICRO
from impact_rig.results.palette import CONTACT, GREY, HAMMER, SPECIMEN
from impact_rig.results.traces import (
    AlignedHit,
    HitTraces,
    SampleTraces,
    TracedCampaign,
    compute_law_curves,
)

if TYPE_CHECKING:
    import rerun as rr

HIT_WIDTH = 1.5
"""Line width of the last hit [points]."""
TREND_SIZE = 3.0
"""Size of one hit's point in a trend [points]."""
LINES = (Look("hammer", HAMMER, HIT_WIDTH), Look("sample", SPECIMEN, HIT_WIDTH))
ACCEPTED = "accepted"
REJECTED = "rejected"
TRENDS = {
    entities.CONTACT_TIME: CONTACT,
    entities.HAMMER_PEAK: HAMMER,
    entities.SPECIMEN_PEAK: SPECIMEN,
}
"""Colours of the accepted hits, by quantity."""
NO_HIT = "No hit yet."
NOTHING = "Nothing measured."
"""Written where nothing can be shown: in texts and in plots."""


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
        self._trends: dict[str, str] = {}
        self._layout: tuple[object, ...] | None = None
        self._hammer = ACCELERATION
        self._last_line = ""  # of the log
        self._summarised: set[str] = set()

    def log_setup(
        self,
        name: str,
        sample_names: Sequence[str],
        contact_times: Sequence[float] = (),
        hammer_reading: tuple[float, str] = ACCELERATION,
        last_record: int = 0,
        *,
        is_live: bool = True,
    ) -> None:
        """Begin a campaign: hide the one before, and lay the view out for a sample set.

        With the same samples as before the layout stays as the user has arranged it.

        Parameters
        ----------
        name : str
            Of the rig; the recording is called by it. Empty: not known.
        sample_names : sequence of str
            In their order.
        contact_times : sequence of float
            Those that are expected [s], NaN where not known: plots then begin with the part of
            the time in which something happens. Without any they begin with whole records.
        hammer_reading : tuple of float and str
            What the hammer's sensor measures at 1 m/s^2, and its unit.
        last_record : int
            The last of the campaign; 0: it is still to come.
        is_live : bool
            Whether hits are still to come: until then its plots say that there is nothing.
        """
        self._hammer = hammer_reading
        self._plots.hide()
        self._trends.clear()
        summaries = (_make_summary_path(sample) for sample in (*self._summarised, *sample_names))
        for path in dict.fromkeys((entities.VERDICT, entities.TABLES, *summaries)):
            self._log_document(path, NO_HIT)
        if is_live:
            self._plots.write_in_blanks(_list_plots(sample_names), NOTHING)
        if name:
            # A rig says its set-up before a campaign does: it is one beginning.
            if self._last_line != (line := f"campaign of {name}"):
                self._log_lines([line], [self._rr.TextLogLevel.INFO])
            self._stream.send_recording_name(name)
        layout = (*sample_names, hammer_reading[1])
        if self._layout != layout:
            self._layout = layout
            blueprint = make_blueprint(sample_names, contact_times, hammer_reading[1], last_record)
            self._stream.send_blueprint(blueprint)

    def log_hit(self, traces: HitTraces) -> None:
        """Show the traces of a record; they replace the last one's."""
        self._plots.hide(entities.HITS)
        path = self._plots.draw(entities.HITS, traces.time, traces.values, LINES)
        self._stream.log(path, self._rr.AnyValues(**asdict(traces.label)), static=True)

    def log_verdicts(self, hits: Sequence[HitResults], stamps: Sequence[int]) -> None:
        """Show the last hit's verdict, and add all to the log and the trends.

        Parameters
        ----------
        hits : sequence of HitResults
            At least one.
        stamps : sequence of int
            Times of the hits, nanoseconds since the epoch.
        """
        self._log_document(entities.VERDICT, format_verdict(hits[-1], self._hammer))
        rr = self._rr
        indexes = [
            rr.TimeColumn(entities.HIT, sequence=[hit.record for hit in hits]),
            rr.TimeColumn(entities.WALL_CLOCK, timestamp=np.array(stamps, "datetime64[ns]")),
        ]
        levels = [rr.TextLogLevel.INFO if hit.accepted else rr.TextLogLevel.WARN for hit in hits]
        self._log_lines(list(map(format_log_line, hits)), levels, indexes)
        seconds = np.array([hit.record for hit in hits], "timedelta64[s]")
        indexes.append(
            rr.TimeColumn(entities.HIT_TIME, duration=seconds.astype("timedelta64[ns]"))
        )
        values = (
            [hit.contact_time * MICRO for hit in hits],
            [self._hammer[0] * hit.hammer_peak for hit in hits],
            [hit.specimen_peak for hit in hits],
        )
        accepted = np.array([[hit.accepted, not hit.accepted] for hit in hits])
        for quantity, column in zip(TRENDS, values, strict=True):
            if np.isfinite(column).any():
                rows = make_scalars(np.where(accepted, np.array(column)[:, np.newaxis], np.nan))
                path = self._begin_trend(quantity)
                self._stream.send_columns(path, indexes=indexes, columns=[rows])

    def log_aligned_hits(self, hits: Sequence[AlignedHit]) -> None:
        """Add hits to the aligned hits of their samples; for hits in the mean."""
        overlays: dict[tuple[str, float], list[AlignedHit]] = defaultdict(list)
        for hit in hits:
            overlays[hit.label.sample, hit.sampling_rate].append(hit)
        for overlay in overlays.values():
            draw_aligned_hits(self._plots, overlay)

    def log_sample(self, traces: SampleTraces, law: ContactLaw, setup: RigSetup) -> None:
        """Show a sample's mean, models, residuals, marks and law; they replace older ones."""
        draw_sample(self._plots, traces)
        draw_law(self._plots, traces.name, law, compute_law_curves(law, traces, setup))

    def log_results(self, results: Results) -> None:
        """Show the tables and the results of each sample; they replace older ones."""
        self._log_document(entities.TABLES, format_results(results))
        for sample in results.samples:
            self._summarised.add(sample.name)
            self._log_document(_make_summary_path(sample.name), format_summary(results, sample))

    def log_campaign(self, campaign: TracedCampaign) -> None:
        """Show a whole campaign at once.

        Samples without hits are left out, unless all are.
        """
        results, hits = campaign.results, campaign.hits
        names = [sample.name for sample in results.samples or results.setup.samples.samples]
        self.log_setup(
            results.setup.name,
            names,
            [sample.paper.contact_time.value for sample in results.samples],
            results.setup.hammer_reading,
            max((hit.result.record for hit in hits), default=0),
            is_live=False,
        )
        if hits:
            self.log_verdicts([hit.result for hit in hits], [hit.stamp for hit in hits])
            self._draw_hits([hit.recorded for hit in hits[:-1]])
            self.log_hit(hits[-1].recorded)
        accepted = [hit.aligned for hit in hits if hit.result.accepted]
        self.log_aligned_hits([hit for hit in accepted if hit is not None])
        laws = {sample.name: sample.contact_law for sample in results.samples}
        for traces in campaign.samples:
            self.log_sample(traces, laws.get(traces.name, NO_LAW), results.setup)
        self.log_results(results)
        self._plots.write_in_blanks(_list_plots(names), NOTHING)

    def _draw_hits(self, hits: Sequence[HitTraces]) -> None:
        """Draw records; those with equal points of time share an entity.

        A row costs three times as much as a value.
        """
        by_time: dict[bytes, list[HitTraces]] = defaultdict(list)
        for hit in hits:
            by_time[hit.time.tobytes()].append(hit)
        for group in by_time.values():
            values = np.concatenate([hit.values for hit in group], axis=1)
            self._plots.draw(entities.HITS, group[0].time, values, LINES * len(group))

    def _begin_trend(self, quantity: str) -> str:
        """Return the entity of a trend; each campaign has new ones."""
        if quantity not in self._trends:
            self._plots.hide((*entities.TRENDS, quantity))
            marks = [
                Look(ACCEPTED, TRENDS[quantity], TREND_SIZE, "circle"),
                Look(REJECTED, GREY, TREND_SIZE, "cross"),
            ]
            self._trends[quantity] = self._plots.add((*entities.TRENDS, quantity), marks)
        return self._trends[quantity]

    def _log_lines(
        self, lines: Sequence[str], levels: Sequence[str], indexes: Sequence[rr.TimeColumn] = ()
    ) -> None:
        """Add lines to the log."""
        rr, self._last_line = self._rr, lines[-1]
        # They are shown only where the timeline of the plots has them, too.
        start = rr.TimeColumn(entities.HIT_TIME, duration=np.zeros(len(lines), "timedelta64[ns]"))
        self._stream.send_columns(
            rr.new_entity_path(entities.LOG),
            indexes=[*indexes, start],
            columns=rr.TextLog.columns(text=lines, level=levels),
        )

    def _log_document(self, path: Path, text: str) -> None:
        document = self._rr.TextDocument(text, media_type=self._rr.MediaType.MARKDOWN)
        # Static: to be seen wherever the time cursor stands.
        self._stream.log(self._rr.new_entity_path(path), document, static=True)


def _list_plots(samples: Iterable[str]) -> list[Path]:
    """Return the families that every view has plots of."""
    parts = [
        *((body, entities.MODELS) for body in BODIES), (entities.LAW,), (entities.LAW_RESIDUAL,)
    ]  # fmt: skip
    return [
        entities.HITS,
        *((*entities.TRENDS, quantity) for quantity in TRENDS),
        *((*entities.SAMPLES, sample, *part) for sample in samples for part in parts),
    ]


def _make_summary_path(sample: str) -> Path:
    return (*entities.SAMPLES, sample, entities.SUMMARY)
