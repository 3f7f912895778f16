"""The pytest fixture `virtual_rig`, a plug-in that loads nothing before it is used."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from impact_rig.testing import RunningRig


@pytest.fixture(scope="module")
def virtual_rig(tmp_path_factory: pytest.TempPathFactory) -> "Iterator[RunningRig]":
    """Return a virtual rig of real nodes in a ROS domain of its own, up for a module's tests."""
    from impact_rig.testing import run_virtual_rig

    with run_virtual_rig(tmp_path_factory.mktemp("rig")) as rig:
        yield rig
