"""Rigs whose nodes and devices are processes, each in its own ROS domain."""

import contextlib

import pytest
from terminal import make_colourful

from impact_rig.nodes.discovery import reserve_domain


@pytest.fixture(scope="module")
def make_environment():
    """Return a function that makes the environment of processes of one test."""
    with contextlib.ExitStack() as domains:
        yield lambda: {
            **make_colourful(),
            "ROS_DOMAIN_ID": str(domains.enter_context(reserve_domain())),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PYTHONUNBUFFERED": "1",
        }
