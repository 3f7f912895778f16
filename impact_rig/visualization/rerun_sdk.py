"""Rerun, imported when it is used: a rig without viewer does not need it."""

from __future__ import annotations

from types import ModuleType

from impact_rig.core.errors import RigError

MINIMUM_VERSION = (0, 41)
"""Oldest rerun-sdk that is known to show everything that is logged here."""


def import_rerun() -> ModuleType:
    """Return the module `rerun`, its blueprint module loaded.

    Raises
    ------
    RigError
        If rerun-sdk is not installed, or too old.
    """
    wanted = ".".join(map(str, MINIMUM_VERSION))
    try:
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
