"""The start of `impact-rig`: while its modules load, Ctrl-C ends it at once and silently."""

import importlib
import signal
from types import ModuleType


def main() -> None:
    """Run the command line; never returns."""
    load_module("impact_rig.cli.main").main()


def load_module(name: str) -> ModuleType:
    """Import a module of a command; Ctrl-C ends the process at once, which harms nothing yet."""
    # Libraries turn a KeyboardInterrupt that comes while they load into errors of their own.
    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        return importlib.import_module(name)
    finally:
        signal.signal(signal.SIGINT, before)
