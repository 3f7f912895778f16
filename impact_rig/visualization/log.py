"""What is logged into a Rerun recording: hits, comparisons, tables.

Traces are logged over the time inside the hit, one entity with a column per channel (five times
smaller and faster than an entity per trace), as float32, with their peaks kept at any zoom. Rerun
cannot take back what was logged on a timeline; so each version of a plot is an entity of its own,
and what it supersedes is hidden under the one name "earlier".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.signals.record import FloatArray
from impact_rig.results.hit_traces import Float32Array, HitTraces
from impact_rig.visualization import entities
from impact_rig.visualization.blueprint import make_blueprint
from impact_rig.visualization.rerun_sdk import import_rerun
from impact_rig.visualization.text import (
    EstimateTable,
    Verdict,
    format_percent,
    write_log_line,
    write_table,
    write_verdict,
)

if TYPE_CHECKING:
    import rerun as rr

MEASURED_WIDTH = 3.0
"""Line width of measured traces [points], our choice: the model lies visibly on top."""
MODEL_WIDTH = 1.25
"""Line width of model traces [points]."""
HIT_WIDTH = 1.5
"""Line width of a single hit [points]."""
CONTACT_MARK_SIZE = 3.0
"""Size of the marks at both ends of the contact [points]."""


@dataclass(frozen=True)
class ComparisonTraces:
    """Mean measured traces of one sample and the model's, normalised.

    Attributes
    ----------
    sample : str
        Name of the sample.
    model : str
        "driven" or "printed".
    time : ndarray of float64, shape (n,)
        From the start of the contact [s].
    hammer_measured, hammer_model, specimen_measured, specimen_model : ndarray, shape (n,)
        Acceleration over its own peak [-].
    contact_time : float
        tau_p of the model [s].
    mse_hammer_percent, mse_sample_percent : float
        Mean square error over the record [%].
    """

    sample: str
    model: str
    time: FloatArray
    hammer_measured: NDArray[Any]
    hammer_model: NDArray[Any]
    specimen_measured: NDArray[Any]
    specimen_model: NDArray[Any]
    contact_time: float
    mse_hammer_percent: float
    mse_sample_percent: float


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
        self._versions: dict[tuple[str, ...], int] = {}

    def log_setup(self, name: str, sample_names: Sequence[str]) -> None:
        """Lay the view out for a sample set and call the recording by the rig's name."""
        if name:
            self._stream.send_recording_name(name)
        self._stream.send_blueprint(make_blueprint(sample_names))

    def log_hit(self, traces: HitTraces) -> None:
        """Show a record's traces in place of the last one's; an empty record shows nothing."""
        path = self._supersede(entities.HITS, series=2)
        label = traces.label
        self._style(
            path,
            names=["hammer", "sample"],
            colours=[entities.HAMMER_COLOUR, entities.SPECIMEN_COLOUR],
            widths=[HIT_WIDTH, HIT_WIDTH],
        )
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
        self._send_traces(path, traces.time, traces.values)

    def log_verdict(self, verdict: Verdict, stamp: int) -> None:
        """Show a hit's verdict, and add it to the log.

        Parameters
        ----------
        verdict : Verdict
            On the hit.
        stamp : int
            Time of the hit, nanoseconds since the epoch.
        """
        self._log_document(entities.VERDICT, write_verdict(verdict))
        level = self._rr.TextLogLevel.INFO if verdict.accepted else self._rr.TextLogLevel.WARN
        self.log_progress(write_log_line(verdict), level, verdict.label.record, stamp)

    def log_progress(self, text: str, level: str, record: int, stamp: int) -> None:
        """Add a line to the log.

        Parameters
        ----------
        text : str
            Plain text.
        level : str
            Rerun's name of the severity, such as "INFO".
        record : int
            Number of the record it is about.
        stamp : int
            Nanoseconds since the epoch.
        """
        rr = self._rr
        self._stream.send_columns(
            rr.new_entity_path(entities.LOG),
            indexes=[
                rr.TimeColumn(entities.HIT, sequence=[record]),
                rr.TimeColumn(entities.WALL_CLOCK, timestamp=np.array([stamp], "datetime64[ns]")),
                # A line is shown only where the timeline of the plots has it, too.
                rr.TimeColumn(entities.HIT_TIME, duration=np.zeros(1, "timedelta64[ns]")),
            ],
            columns=rr.TextLog.columns(text=[text], level=[level]),
        )

    def log_comparison(self, comparison: ComparisonTraces) -> None:
        """Show a sample's traces beside the model's, in place of what was shown before."""
        family = (*entities.COMPARISONS, comparison.model, comparison.sample)
        path = self._supersede(family, series=4, has_contact=True)
        self._style(
            path,
            names=[
                "hammer, measured",
                f"hammer, model (MSE {format_percent(comparison.mse_hammer_percent)} %)",
                "sample, measured",
                f"sample, model (MSE {format_percent(comparison.mse_sample_percent)} %)",
            ],
            colours=[
                entities.HAMMER_COLOUR,
                entities.HAMMER_MODEL_COLOUR,
                entities.SPECIMEN_COLOUR,
                entities.SPECIMEN_MODEL_COLOUR,
            ],
            widths=[MEASURED_WIDTH, MODEL_WIDTH, MEASURED_WIDTH, MODEL_WIDTH],
        )
        traces = (
            comparison.hammer_measured,
            comparison.hammer_model,
            comparison.specimen_measured,
            comparison.specimen_model,
        )
        self._send_traces(path, comparison.time, np.stack(traces, axis=1))
        self._log_contact(f"{path}/contact", comparison.contact_time)

    def log_estimates(self, table: EstimateTable) -> None:
        """Show the table of measured and expected values."""
        self._log_document(entities.TABLE, write_table(table))

    def _log_document(self, path: Sequence[str], text: str) -> None:
        document = self._rr.TextDocument(text, media_type=self._rr.MediaType.MARKDOWN)
        # Static: to be seen wherever the time cursor stands.
        self._stream.log(self._rr.new_entity_path(path), document, static=True)

    def _log_contact(self, path: str, contact_time: float) -> None:
        self._stream.log(
            path,
            self._rr.SeriesPoints(
                colors=[entities.CONTACT_COLOUR],
                markers=["diamond"],
                marker_sizes=[CONTACT_MARK_SIZE],
                names=[f"contact, {contact_time * 1e6:.2f} µs"],
            ),
            static=True,
        )
        self._send_traces(path, np.array([0.0, contact_time]), np.zeros((2, 1)))

    def _style(
        self,
        path: str,
        names: Sequence[str],
        colours: Sequence[entities.Colour],
        widths: Sequence[float],
    ) -> None:
        lines = self._rr.SeriesLines(
            names=names, colors=colours, widths=widths, aggregation_policy="MinMax"
        )
        self._stream.log(path, lines, static=True)

    def _send_traces(self, path: str, time: FloatArray, values: NDArray[Any]) -> None:
        """Log columns of values, shape (n, columns), over the time inside the hit [s]."""
        if time.size == 0:
            return
        nanoseconds = np.rint(time * 1e9).astype("timedelta64[ns]")
        self._stream.send_columns(
            path,
            indexes=[self._rr.TimeColumn(entities.HIT_TIME, duration=nanoseconds)],
            columns=[self._make_column(values)],
        )

    def _make_column(self, values: NDArray[Any]) -> rr.ComponentColumn:
        rows, columns = values.shape
        column: rr.ComponentColumn = self._rr.ComponentColumn(
            self._rr.Scalars.descriptor_scalars(),
            _SinglePrecision(values),
            offsets=np.arange(0, rows * columns + 1, columns, dtype=np.int32),
        )
        return column

    def _supersede(
        self, family: tuple[str, ...], series: int, *, has_contact: bool = False
    ) -> str:
        """Hide a family's present version and return the entity path of its next one."""
        rr = self._rr
        version = self._versions.get(family, 0)
        self._versions[family] = version + 1
        if version > 0:
            last = rr.new_entity_path([*family, version])
            lines = rr.SeriesLines.from_fields(
                visible_series=[False] * series,
                names=[entities.EARLIER] * series,
                colors=[entities.EARLIER_COLOUR] * series,
            )
            self._stream.log(last, lines, static=True)
            if has_contact:
                points = rr.SeriesPoints.from_fields(
                    visible_series=[False],
                    names=[entities.EARLIER],
                    colors=[entities.EARLIER_COLOUR],
                )
                self._stream.log(f"{last}/contact", points, static=True)
        return str(rr.new_entity_path([*family, version + 1]))


class _SinglePrecision:
    """Scalars as float32: Rerun's own class would make them twice as large."""

    def __init__(self, values: NDArray[Any]) -> None:
        self._values: Float32Array = np.ascontiguousarray(values, dtype=np.float32)

    def as_arrow_array(self) -> Any:
        """Return all values, row by row."""
        import pyarrow as pa

        return pa.array(self._values.reshape(-1))
