"""What stands behind a driver in its contract tests: a device, or a peer that speaks like one."""

from types import TracebackType
from typing import Any, Self

import pytest

from impact_rig.devices.acceleration_source import AccelerationSource, AcquisitionPlan
from impact_rig.devices.hammer_holder import HammerHolder


class Bench:
    """A device on a bench: it can be there or not.

    Subclasses override what they can do; the rest is skipped.
    """

    def __enter__(self) -> Self:
        """Make the device ready."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Put everything away."""

    def get_driver(self) -> Any:
        """Return the driver's class."""
        raise NotImplementedError

    def unplug(self) -> None:
        """Let the device vanish as if its cable was pulled."""
        pytest.skip("this bench cannot unplug its device")

    def plug(self) -> None:
        """Let it come back."""


class SourceBench(Bench):
    """A source, and somebody who strikes the hammer."""

    def make_source(self) -> AccelerationSource:
        """Return a new source for the device, not configured."""
        raise NotImplementedError

    def make_plan(self, *, continuous: bool = False) -> AcquisitionPlan:
        """Return a plan that the device can do, its record longer than one block."""
        raise NotImplementedError

    def strike(self, source: AccelerationSource) -> None:
        """Let the hammer strike now, well above the trigger level; do not wait for the record."""
        pytest.skip("nobody strikes the hammer of this bench")


class HolderBench(Bench):
    """A holder, and what its device really does."""

    def make_holder(self) -> HammerHolder:
        """Return a new holder for the device, not configured."""
        raise NotImplementedError

    def is_holding(self) -> bool:
        """Return whether the device holds, asked at the device and not at the driver."""
        pytest.skip("this bench does not see what its device does")

    def count_releases(self) -> int:
        """Return how often the device has let go so far."""
        pytest.skip("this bench does not see what its device does")
