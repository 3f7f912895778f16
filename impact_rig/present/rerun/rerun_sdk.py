"""Rerun, imported when it is used: a rig without viewer does not need it."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from types import ModuleType

from impact_rig.core.errors import RigError

MINIMUM_VERSION = (0, 41)
"""Oldest tested rerun-sdk."""

LOG_VARIABLE = "RUST_LOG"
"""Variable for the logging of programs in Rust, as Rerun."""


def import_rerun() -> ModuleType:
    """Return the module `rerun`, its blueprint module loaded.

    Raises
    ------
    RigError
        If rerun-sdk is not installed, or too old.
    """
    wanted = ".".join(map(str, MINIMUM_VERSION))
    try:
        with _keep_silent():
            import rerun
            import rerun.blueprint
    except ImportError as error:
        raise RigError(
            "the view needs the Python package rerun-sdk, which is not installed:"
            f" pip install 'rerun-sdk>={wanted}'"
        ) from error
    version = tuple(int(part) for part in rerun.__version__.split(".")[:2])
    if version < MINIMUM_VERSION:
        raise RigError(
            f"rerun-sdk {rerun.__version__} is too old for the view:"
            f" pip install 'rerun-sdk>={wanted}'"
        )
    return rerun


@contextlib.contextmanager
def _keep_silent() -> Iterator[None]:
    """Turn off Rerun's own logging, unless the environment sets it.

    Rerun reads the variable when it is imported. Its users report errors in a sentence.
    """
    if LOG_VARIABLE in os.environ or "rerun" in sys.modules:
        yield
        return
    os.environ[LOG_VARIABLE] = "off"
    try:
        yield
    finally:
        os.environ.pop(LOG_VARIABLE, None)
