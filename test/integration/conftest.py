"""Rigs whose nodes and devices are processes, each in its own ROS domain."""

import pytest
from terminal import make_colourful


@pytest.fixture
def environment(ros_domain):
    """Return the environment of a test's processes."""
    return {**make_colourful(), "PYTHONUNBUFFERED": "1"}
