"""A bar that shows how far a command is, as long as it works."""

from types import TracebackType
from typing import Any, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn

DEFAULT_WIDTH = 40
"""Of the bar [characters]; rich's default."""
SPEED_PERIOD = 30.0
"""Over which the speed, and with it the time left, is averaged [s]; rich's default."""


class ProgressBar:
    """Draws a bar in a ``with`` statement, and takes it away; without a terminal, nothing.

    Parameters
    ----------
    console : Console
        Where to draw.
    title : str
        Stands before the bar, until `update` gives another ``description``.
    columns : ProgressColumn
        Stand behind the bar.
    total : float, optional
        What `update` counts up to by ``completed``; None: not known.
    is_wide : bool
        Whether the bar takes what the line has left.
    is_shown : bool
        Whether it is worth a bar.
    speed_period : float
        Over which the speed is averaged [s].
    fields : Any
        Of the task, for columns that show them.
    """

    def __init__(
        self,
        console: Console,
        title: str,
        *columns: ProgressColumn,
        total: float | None = None,
        is_wide: bool = False,
        is_shown: bool = True,
        speed_period: float = SPEED_PERIOD,
        **fields: Any,
    ) -> None:
        self.console = console
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=None if is_wide else DEFAULT_WIDTH),
            *columns,
            console=console,
            transient=True,
            expand=is_wide,
            disable=not (console.is_terminal and is_shown),
            speed_estimate_period=speed_period,
        )
        self._task = self._progress.add_task(title, total=total, **fields)

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

    def show(self) -> None:
        """Draw again."""
        self._progress.start()

    def hide(self) -> None:
        """Leave the terminal to others."""
        self._progress.stop()

    def update(self, **changes: Any) -> None:
        """Change ``description``, ``total``, ``completed`` or a field."""
        self._progress.update(self._task, **changes)
