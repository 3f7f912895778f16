"""Rigs whose nodes and devices are processes, each in a ROS domain of its own."""

import contextlib
import os

import pytest

from impact_rig.nodes.discovery import reserve_domain


@pytest.fixture(scope="module")
def make_environment():
    """Return a function that makes the environment of processes that meet nobody else."""
    with contextlib.ExitStack() as domains:
        yield lambda: {
            **os.environ,
            "ROS_DOMAIN_ID": str(domains.enter_context(reserve_domain())),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PYTHONUNBUFFERED": "1",
            # Whatever width of a terminal stands in the environment: lines are looked for whole.
            "COLUMNS": "1000",
        }
