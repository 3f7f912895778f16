"""A bar that shows how far a command is, as long as it works."""

import math
import sys
import time
from collections.abc import Iterable
from types import TracebackType
from typing import Any, Self

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.progress import BarColumn, Progress, ProgressColumn, Task
from rich.table import Table
from rich.text import Text

from impact_rig.reporting.terminal.columns import COLUMN_GAP, make_printable
from impact_rig.reporting.terminal.console import EASY_LINE, GOOD

WIDEST_BAR = 40
"""[characters], our choice: a longer one says no more."""
NARROWEST_BAR = 8
"""Shorter ones are left out [characters], our choice."""
SPEED_PERIOD = 30.0
"""Over which the speed, and with it the time left, is averaged [s]; rich's default."""
PATIENCE = 1.0
"""What is done sooner needs no bar [s], our choice: one that flashes up says nothing."""
MINUTE = 60.0
HOUR = 3600.0


class TimeLeft(ProgressColumn):
    """How long it still takes at this speed, once that is known."""

    def render(self, task: Task) -> Text:
        """Return the time left in words; nothing while it is not known."""
        left = task.time_remaining
        return Text("" if left is None or task.finished else format_time_left(left))


def format_time_left(seconds: float) -> str:
    """Return a time left in words, as exact as anybody wants it; nothing for NaN."""
    if not math.isfinite(seconds):
        return ""
    if seconds < MINUTE:
        return f"{seconds:.0f} s left"
    if seconds < HOUR:
        return f"{math.ceil(seconds / MINUTE)} min left"
    return f"{seconds / HOUR:.1f} h left"


class ProgressBar:
    """Draws a bar in a ``with`` statement, and takes it away; without a terminal, nothing.

    Parameters
    ----------
    console : Console
        Where to draw.
    title : str
        Stands before the bar, until `update` gives another ``description``.
    columns : ProgressColumn
        Figures, stand behind the bar.
    total : float, optional
        What `update` counts up to by ``completed``; None: not known.
    patience : float
        How long it must take before it is worth a bar [s]; `update` looks at the clock.
    speed_period : float
        Over which the speed is averaged [s].
    fields : Any
        Of the task, for columns that show them; ``status``: text that stands below the bar.
    """

    def __init__(
        self,
        console: Console,
        title: str,
        *columns: ProgressColumn,
        total: float | None = None,
        patience: float = 0.0,
        speed_period: float = SPEED_PERIOD,
        **fields: Any,
    ) -> None:
        self.console = console
        self._progress = _OneTask(
            *columns,
            console=console,
            transient=True,
            # What a command prints goes above the bar, but not what it writes into a pipe.
            redirect_stdout=sys.stdout.isatty(),
            disable=not console.is_interactive,
            speed_estimate_period=speed_period,
        )
        self._task = self._progress.add_task(title, total=total, **{"status": "", **fields})
        self._due = time.monotonic() + patience
        self._is_shown = False

    def __enter__(self) -> Self:
        """Begin to draw."""
        self.show()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Take the bar away."""
        self.hide()

    @property
    def is_drawn(self) -> bool:
        """Whether a person sees the bar; else what happens must be told in lines."""
        return self.console.is_interactive

    def show(self) -> None:
        """Draw, or draw again."""
        self._is_shown = True
        self._start_if_due()

    def hide(self) -> None:
        """Leave the terminal to others."""
        self._is_shown = False
        self._progress.stop()

    def update(self, **changes: Any) -> None:
        """Change ``description``, ``total``, ``completed`` or a field."""
        self._progress.update(self._task, **changes)
        self._start_if_due()

    def restart(self, description: str, total: float) -> None:
        """Count from nought again: something else is done now, at another speed."""
        self._progress.reset(self._task, description=description, total=total)
        self._start_if_due()

    def _start_if_due(self) -> None:
        if self._is_shown and time.monotonic() >= self._due:
            self._progress.start()


class _OneTask(Progress):
    """rich's progress, laid out for terminals of any width."""

    def __init__(self, *columns: ProgressColumn, **options: Any) -> None:
        super().__init__(*columns, **options)
        self.columns = columns  # rich has some of its own where there are none

    def get_renderables(self) -> Iterable[RenderableType]:
        for task in self.tasks:
            figures = [column(task) for column in self.columns if not isinstance(column, str)]
            yield _Layout(task, [item for item in figures if isinstance(item, Text) and item])


class _Layout:
    """Title, bar and figures in a line, or below each other where that is too long."""

    def __init__(self, task: Task, figures: list[Text]) -> None:
        self._task = task
        self._figures = Text(", ").join(figures)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        # The last place stays free: some terminals begin a new line there.
        width = max(1, min(options.max_width, EASY_LINE) - 1)
        title = Text(make_printable(self._task.description), overflow="fold")
        gap, figures = len(COLUMN_GAP), self._figures.cell_len
        room = width - cell_len(title.plain) - figures - 2 * gap
        lines: list[RenderableType] = []
        if room < NARROWEST_BAR:
            lines.append(title)
            title, room = Text(), width - figures - gap
        if room < NARROWEST_BAR:
            lines.append(self._figures)
        else:
            lines.append(self._make_line(title, min(room, WIDEST_BAR)))
        if status := self._task.fields["status"]:
            lines.append(status if isinstance(status, Text) else Text(make_printable(status)))
        yield from console.render(Group(*lines), options.update(width=width))

    def _make_line(self, title: Text, width: int) -> Table:
        line = Table.grid(padding=(0, len(COLUMN_GAP), 0, 0), pad_edge=False)
        bar = BarColumn(width, style="dim", complete_style=GOOD, finished_style=GOOD)
        cells = [item for item in (title, bar(self._task), self._figures) if item]
        for _ in cells:
            line.add_column(no_wrap=True)
        line.add_row(*cells)
        return line
