"""Health of the nodes: the newest state as text, and its history."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from impact_rig.present.rerun import entities
from impact_rig.present.rerun.markdown import escape_markdown
from impact_rig.present.rerun.rerun_sdk import import_rerun
from impact_rig.results.palette import GREEN, GREY, ORANGE, VERMILION

if TYPE_CHECKING:
    import rerun as rr


class Level(IntEnum):
    """How well a node is; the numbers are those of `diagnostic_msgs/DiagnosticStatus`."""

    OK = 0
    WARNING = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class NodeHealth:
    """The newest state of one node."""

    name: str
    level: int = Level.OK  # a `Level`; any other number counts as an error
    message: str = ""
    values: tuple[tuple[str, str], ...] = ()  # names and texts of its figures


@dataclass(frozen=True)
class Health:
    """The newest state of all nodes of a rig.

    The view keeps the history of rates ("blocks per second") and losses ("gaps", "missing
    points", "views dropped", "impacts rejected"), by the name of the figure.
    """

    nodes: tuple[NodeHealth, ...]
    stamp: int  # [ns since the epoch]


RATES = "rates"
LOSSES = "losses"
LEVELS = "levels"
"""Plots of the history."""
RATE_ENDINGS = (" per second", "/s")
"""Endings of the names of rates."""
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
NO_HEALTH = "No node has published its state. The view of a file has none."


class HealthLog:
    """Logs the health of a rig."""

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._rr = import_rerun()
        self._stream = stream
        self._levels: dict[str, Level] = {}

    def log(self, health: Health) -> None:
        """Add figures and changes of level to the history."""
        for node in health.nodes:
            self._log_level(node, health.stamp)
            for name, text in node.values:
                kind, value = choose_kind(name), read_figure(text)
                if kind and math.isfinite(value):
                    path = (*entities.HEALTH_HISTORY, kind, node.name, name)
                    self._send(path, health.stamp, self._rr.Scalars.columns(scalars=[value]))

    def _log_level(self, node: NodeHealth, stamp: int) -> None:
        level = read_level(node)
        if self._levels.get(node.name) == level:
            return
        path = (*entities.HEALTH_HISTORY, LEVELS, node.name)
        if node.name not in self._levels:
            configuration = self._rr.StateConfiguration(
                values=[item.name.lower() for item in COLOURS], colors=list(COLOURS.values())
            )
            self._stream.log(self._rr.new_entity_path(path), configuration, static=True)
        self._levels[node.name] = level
        self._send(path, stamp, self._rr.StateChange.columns(state=[level.name.lower()]))

    def _send(self, path: entities.Path, stamp: int, columns: rr.ComponentColumnList) -> None:
        moment = np.array([stamp], "datetime64[ns]")
        self._stream.send_columns(
            self._rr.new_entity_path(path),
            indexes=[self._rr.TimeColumn(entities.WALL_CLOCK, timestamp=moment)],
            columns=columns,
        )


def read_level(node: NodeHealth) -> Level:
    """Return the level of a node; an unknown number is an error."""
    return Level(node.level) if node.level in set(Level) else Level.ERROR


def choose_kind(name: str) -> str:
    """Return the plot of a figure, by its name; empty: it has none."""
    if name.endswith(RATE_ENDINGS):
        return RATES
    if any(word in name for word in LOSS_WORDS):
        return LOSSES
    return ""


def read_figure(text: str) -> float:
    """Return the number that a figure starts with; NaN without one."""
    try:
        return float(text.split(maxsplit=1)[0])
    except (ValueError, IndexError):
        return math.nan


def _format_figure(name: str, text: str) -> str:
    size = read_figure(text)
    shown = f"{size / GIGABYTE:.3f} GB" if name == SIZE and math.isfinite(size) else text
    return f"{escape_markdown(name)} **{escape_markdown(shown)}**"


def format_health(nodes: Sequence[NodeHealth]) -> str:
    """Return the state of the nodes as Markdown, worst first."""
    if not nodes:
        return NO_HEALTH
    paragraphs = []
    for node in sorted(nodes, key=read_level, reverse=True):
        level = read_level(node)
        title = f"## {SIGNS[level]} {escape_markdown(node.name)}: {level.name.lower()}"
        paragraphs += [title, escape_markdown(node.message)]
        figures = [_format_figure(name, text) for name, text in node.values if text]
        paragraphs += [" · ".join(figures)] if figures else []
    return "\n\n".join(paragraphs)
