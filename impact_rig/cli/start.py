"""The start of `impact-rig`: while its modules load, Ctrl-C ends it at once and silently."""

import contextlib
import importlib
import signal
from collections.abc import Iterator
from types import ModuleType


def main() -> None:
    """Run the command line; never returns."""
    load_module("impact_rig.cli.main").main()


def load_module(name: str) -> ModuleType:
    """Import a module of a command; Ctrl-C ends the process at once, which harms nothing yet."""
    with _end_at_interrupt():
        return importlib.import_module(name)


@contextlib.contextmanager
def _end_at_interrupt() -> Iterator[None]:
    # Libraries turn a KeyboardInterrupt that comes while they load into errors of their own.
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


if __name__ == "__main__":
    main()
