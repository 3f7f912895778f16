"""Tests of yours: of a driver, of a program that talks to a rig, of an estimator.

- A driver: subclass `AccelerationSourceContract` or `HammerHolderContract`, see `drivers`.
- A program beside a rig: the pytest fixture `virtual_rig`, which is there once `impact_rig` is
  installed, is a `RunningRig`; `run_rig` starts that of any rig file, also in a script.
- A node: the fixture `harness` is a `harness.Harness`, which runs nodes in the test's process.
- An estimator: `score`, or `score_node` for one that is a node.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from impact_rig.nodes.discovery import use_own_domain
    from impact_rig.testing.drivers import (
        AccelerationSourceContract,
        Applied,
        Bench,
        DriverContract,
        HammerHolderContract,
        HolderBench,
        SourceBench,
        make_plan,
    )
    from impact_rig.testing.running import RunningRig, run_rig, run_virtual_rig
    from impact_rig.testing.scoring import Score, score, score_node

__all__ = [
    "AccelerationSourceContract",
    "Applied",
    "Bench",
    "DriverContract",
    "HammerHolderContract",
    "HolderBench",
    "RunningRig",
    "Score",
    "SourceBench",
    "make_plan",
    "run_rig",
    "run_virtual_rig",
    "score",
    "score_node",
    "use_own_domain",
]


def __getattr__(name: str) -> Any:
    """Load what is used: estimators are scored without pytest."""
    for part in ("scoring", "running", "drivers") if name in __all__ else ():
        module = import_module(f"{__name__}.{part}")
        if hasattr(module, name):
            return getattr(module, name)
    raise AttributeError(f"module 'impact_rig.testing' has no attribute {name!r}")
