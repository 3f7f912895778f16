"""Destinations and Rerun's own program, both ended after each test."""

import subprocess

import psutil
import pytest

from impact_rig.visualization.destinations.opening import DestinationPlan, open_destinations
from impact_rig.visualization.destinations.program import find_viewer

from .onlookers import fail, list_listeners, wait_until


@pytest.fixture
def open_all():
    """Return a function that opens destinations, which are closed at the end."""
    opened = []

    def run(*, announce=fail, notify=fail, **plan):
        opened.extend(open_destinations(DestinationPlan(**plan), announce=announce, notify=notify))
        return opened

    yield run
    for destination in opened:
        destination.close()
    # A server goes after its stream: none is to be found by the next test.
    own = psutil.Process()
    wait_until(lambda: all(item.status != psutil.CONN_LISTEN for item in own.net_connections()))


@pytest.fixture
def start():
    """Return a function that starts Rerun's program and returns once a port of it is open."""
    processes = []

    def run(port, *arguments):
        process = subprocess.Popen(
            [find_viewer(), "--bind", "127.0.0.1", "--port", str(port), *map(str, arguments)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        processes.append(process)

        def is_open():
            assert process.poll() is None
            return any(item.laddr.port == port for item in list_listeners(process.pid))

        wait_until(is_open)
        return process

    yield run
    for process in processes:
        process.kill()
        process.wait()


@pytest.fixture
def viewer(start):
    """Return a function that starts what a viewer has of a network, without its windows."""
    return lambda port: start(port, "--serve-grpc")
