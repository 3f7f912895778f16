"""Health of the nodes: the newest state as text, and its history."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from impact_rig.present.rerun import entities
from impact_rig.present.rerun.markdown import escape_markdown
from impact_rig.present.rerun.viewers import import_rerun
from impact_rig.results.palette import GREEN, GREY, ORANGE, VERMILION
from impact_rig.status.states import Level, NodeHealth

if TYPE_CHECKING:
    import rerun as rr


LOSSES = "losses"
LEVELS = "levels"
"""Plots of the history."""
LOSS_WORDS = ("gap", "missing", "dropped", "lost", "rejected")
"""Words in the names of losses."""
COLOURS = {
    Level.OK: GREEN,
    Level.WARNING: ORANGE,
    Level.ERROR: VERMILION,
    Level.STALE: GREY,
}
GIGABYTE = 1e9
SIZE = "size"
"""A figure in bytes."""
SIGNS = {Level.OK: "✓", Level.WARNING: "⚠", Level.ERROR: "✗", Level.STALE: "?"}


class HealthLog:
    """Logs the health of a rig.

    The view keeps the history of losses ("gaps", "missing points"), by the name of the figure.
    """

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._rr = import_rerun()
        self._stream = stream
        self._levels: dict[str, Level] = {}
        self._start: int | None = None  # [ns since the epoch]; None: nothing was logged

    def log(self, nodes: Sequence[NodeHealth], stamp: int) -> None:
        """Add figures and changes of level to the history; `stamp` is in ns since the epoch."""
        for node in nodes:
            self._log_level(node, stamp)
            for name, text in node.values:
                value = _read_figure(text)
                if any(word in name for word in LOSS_WORDS) and math.isfinite(value):
                    path = (*entities.HEALTH_HISTORY, LOSSES, node.name, name)
                    self._send(path, stamp, self._rr.Scalars.columns(scalars=[value]))

    def _log_level(self, node: NodeHealth, stamp: int) -> None:
        if self._levels.get(node.name) == node.level:
            return
        path = (*entities.HEALTH_HISTORY, LEVELS, node.name)
        if node.name not in self._levels:
            configuration = self._rr.StateConfiguration(
                values=[item.name.lower() for item in COLOURS], colors=list(COLOURS.values())
            )
            self._stream.log(self._rr.new_entity_path(path), configuration, static=True)
        self._levels[node.name] = node.level
        change = self._rr.StateChange.columns(state=[node.level.name.lower()])
        self._send(path, stamp, change)

    def _send(self, path: entities.Path, stamp: int, columns: rr.ComponentColumnList) -> None:
        self._start = stamp if self._start is None else self._start
        rr = self._rr
        moment = np.array([stamp], "datetime64[ns]")
        since = np.array([stamp - self._start], "timedelta64[ns]")
        self._stream.send_columns(
            self._rr.new_entity_path(path),
            indexes=[
                rr.TimeColumn(entities.WALL_CLOCK, timestamp=moment),
                rr.TimeColumn(entities.HIT_TIME, duration=since),
            ],
            columns=columns,
        )


def _read_figure(text: str) -> float:
    """Return the number that a figure starts with; NaN without one."""
    try:
        return float(text.split(maxsplit=1)[0])
    except (ValueError, IndexError):
        return math.nan


def _format_figure(name: str, text: str) -> str:
    size = _read_figure(text)
    shown = f"{size / GIGABYTE:.3f} GB" if name == SIZE and math.isfinite(size) else text
    return f"{escape_markdown(name)} **{escape_markdown(shown)}**"


def format_health(nodes: Sequence[NodeHealth]) -> str:
    """Return the state of the nodes as Markdown, worst first."""
    paragraphs = []
    for node in sorted(nodes, key=lambda node: node.level, reverse=True):
        title = f"{SIGNS[node.level]} {escape_markdown(node.name)}: {node.level.name.lower()}"
        paragraphs += [f"## {title}", escape_markdown(node.message)]
        figures = [_format_figure(name, text) for name, text in node.values if text]
        paragraphs += [" · ".join(figures)] if figures else []
    return "\n\n".join(paragraphs)
