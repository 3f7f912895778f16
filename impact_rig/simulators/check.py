"""What the engines make of exported parameters: held against what was measured, step by step."""

import importlib
import importlib.util
import math
from collections.abc import Sequence
from dataclasses import dataclass

from impact_rig.core.errors import ParameterError
from impact_rig.simulators.motion import Motion
from impact_rig.simulators.parameters import ENGINES, Engine, Parameters

STEPS = (1e-3, 1e-4, 1e-5, 5e-6, 1e-6, 5e-7, 1e-7)
"""At which engines are checked [s], our choice: from what robots are simulated with to what a
contact of metal needs."""
PHASES = (0.1, 0.5, 0.9)
"""Of a step, at which the bodies touch [-], our choice: in coarse steps much depends on it."""
LARGEST_DIFFERENCE = 0.02
"""Of duration and of restitution from the measured ones [-], for a step that will do."""


@dataclass(frozen=True)
class EngineCheck:
    """The two bodies in one engine.

    Attributes
    ----------
    parameters : Parameters
        What the engine was given.
    strikes : tuple of tuple of Motion
        From the coarsest step to the finest, each at all of `PHASES`.
    """

    parameters: Parameters
    strikes: tuple[tuple[Motion, ...], ...]

    @property
    def finest(self) -> Motion:
        """At the finest step."""
        return self.strikes[-1][0]

    @property
    def largest_step(self) -> float:
        """From which on duration and restitution are met [s]; NaN: from none of those tried."""
        good = math.nan
        for motions in reversed(self.strikes):
            if not is_met(motions):
                break
            good = motions[0].step
        return good


def is_met(motions: Sequence[Motion]) -> bool:
    """Return whether all have the contact's duration and restitution to `LARGEST_DIFFERENCE`."""
    return all(
        abs(found / wanted - 1.0) <= LARGEST_DIFFERENCE
        for motion in motions
        for found, wanted in (
            (motion.duration, motion.contact.duration),
            (motion.restitution, motion.contact.restitution),
        )
    )


def find_obstacle(engine: Engine) -> str:
    """Return why nothing can be checked in an engine, in a sentence; empty: it can."""
    if not engine.package:
        checked = ", ".join(item.title for item in ENGINES.values() if item.package)
        return f"--check does not run in {engine.title}: it runs in {checked}"
    if importlib.util.find_spec(engine.module) is None:
        return (
            f"--check needs {engine.title}, which is not installed: pip install {engine.package}"
        )
    return ""


def check_engine(parameters: Parameters, steps: Sequence[float] = STEPS) -> EngineCheck:
    """Let the two bodies meet in an engine.

    Parameters
    ----------
    parameters : Parameters
        What the engine is given.
    steps : sequence of float
        From the coarsest to the finest [s].

    Raises
    ------
    ParameterError
        If the engine is not installed, or is none of those that are checked.
    """
    engine = parameters.engine
    if reason := find_obstacle(engine):
        raise ParameterError(reason)
    module = importlib.import_module(f"impact_rig.simulators.{engine.name}_check")
    return EngineCheck(
        parameters,
        tuple(tuple(module.strike(parameters, step, phase) for phase in PHASES) for step in steps),
    )
