"""Fixtures of pytest, in a plug-in that loads nothing before one is used."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from impact_rig.testing import RunningRig
    from impact_rig.testing.harness import Harness


@pytest.fixture(scope="module")
def virtual_rig(tmp_path_factory: pytest.TempPathFactory) -> "Iterator[RunningRig]":
    """Return a virtual rig of real nodes in a ROS domain of its own, up for a module's tests."""
    from impact_rig.testing import run_virtual_rig

    with run_virtual_rig(tmp_path_factory.mktemp("rig")) as rig:
        yield rig


@pytest.fixture
def ros_domain() -> Iterator[int]:
    """Return a free ROS domain, in which all nodes are that a test starts."""
    from impact_rig.testing import use_own_domain

    with use_own_domain() as domain:
        yield domain


@pytest.fixture
def harness(ros_domain: int, tmp_path: Path) -> "Iterator[Harness]":
    """Return a place in this process to run nodes in, in a ROS domain of their own."""
    from impact_rig.cli.libraries import explain_missing

    with explain_missing():
        from impact_rig.testing.harness import Harness
    with closing(Harness(tmp_path / "session.mcap", ros_domain)) as started:
        yield started
