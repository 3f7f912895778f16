"""The impact rig: contact time, stiffness and damping of metal samples from hammer impacts.

As a library::

    import impact_rig as ir

    run = ir.open_run("runs/2026-11-25T21-28-43")
    results = run.analyze()
    print(results["steel small"].contact_time)

What is public is listed in `__all__`; it is loaded when it is used, and needs no ROS.
"""

from typing import TYPE_CHECKING, Any

from impact_rig.version import __version__ as __version__

if TYPE_CHECKING:
    from impact_rig.analysis.hits import Hit
    from impact_rig.api import (
        Run,
        Session,
        VirtualRig,
        compare,
        estimate,
        open_run,
        read_files,
    )
    from impact_rig.core.given.errors import RigError
    from impact_rig.core.given.records import Truth
    from impact_rig.present.printed import Number
    from impact_rig.present.printed_results import Comparison, Results, SampleResults

__all__ = [
    "Comparison",
    "Hit",
    "Number",
    "Results",
    "RigError",
    "Run",
    "SampleResults",
    "Session",
    "Truth",
    "VirtualRig",
    "compare",
    "estimate",
    "open_run",
    "read_files",
]


def __getattr__(name: str) -> Any:
    """Load the library when one of its names is used."""
    if name not in __all__:
        raise AttributeError(f"module 'impact_rig' has no attribute {name!r}")
    from impact_rig import api

    return getattr(api, name)


def __dir__() -> list[str]:
    """Return the public names, which shells complete."""
    return [*__all__, "__version__"]
