"""A bar that shows how far a command is, as long as it works."""

import sys
from collections.abc import Iterable
from types import TracebackType
from typing import Any, Self

from rich.console import Console, RenderableType
from rich.progress import BarColumn, Progress, ProgressColumn
from rich.table import Column, Table
from rich.text import Text

from impact_rig.present.terminal.console import GOOD

WIDEST_BAR = 40  # [characters]


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
    fields : Any
        Of the task, for columns that show them; ``status``: text that stands below the bar.
    """

    def __init__(
        self,
        console: Console,
        title: str,
        *columns: ProgressColumn,
        total: float | None = None,
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
        )
        self._task = self._progress.add_task(title, total=total, **{"status": "", **fields})

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
        """Whether a person sees the bar; otherwise progress is printed in lines."""
        return self.console.is_interactive

    def show(self) -> None:
        """Draw, or draw again."""
        self._progress.start()

    def hide(self) -> None:
        """Leave the terminal to others."""
        self._progress.stop()

    def update(self, **changes: Any) -> None:
        """Change ``description``, ``total``, ``completed`` or a field."""
        self._progress.update(self._task, **changes)

    def report(self, done: float, total: float | None = None) -> None:
        """Show how much is done, of how much if that was not known."""
        self.update(completed=done, total=total)

    def restart(self, description: str, total: float) -> None:
        """Count from zero again: something else is done now, at another speed."""
        self._progress.reset(self._task, description=description, total=total)


class _OneTask(Progress):
    """rich's progress of one task: title, bar with figures, and status, below each other."""

    def __init__(self, *columns: ProgressColumn, **options: Any) -> None:
        super().__init__(*columns, **options)
        self.columns = columns  # rich has default columns where none are given

    def get_renderables(self) -> Iterable[RenderableType]:
        bar = BarColumn(WIDEST_BAR, style="dim", complete_style=GOOD, finished_style=GOOD)
        for task in self.tasks:
            yield Text(task.description)
            figures = [column(task) for column in self.columns if not isinstance(column, str)]
            # The bar shrinks, its figures do not.
            line = Table.grid(Column(), Column(no_wrap=True), padding=(0, 2, 0, 0))
            line.add_row(bar(task), Text(", ").join(filter(None, map(_as_text, figures))))
            yield line
            if status := task.fields["status"]:
                yield _as_text(status)


def _as_text(shown: RenderableType) -> Text:
    return shown if isinstance(shown, Text) else Text(str(shown))
