"""The driver and an instrument that is a process of its own."""

import json
import subprocess
import sys

import pytest

from impact_rig.core.errors import DeviceError

PEER = "impact_rig.devices.peers.scpi_digitizer"


@pytest.fixture
def process():
    """Return a peer that strikes when it is told."""
    command = [sys.executable, "-m", PEER, "--hammer", "5 mV/g", "--specimen", "5 mV/g"]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as peer:
        yield peer
        peer.kill()


def say(peer, word: str) -> None:
    peer.stdin.write(f"{word}\n")
    peer.stdin.flush()


def hear(peer) -> dict:
    return json.loads(peer.stdout.readline())


def test_records_come_from_another_process_until_it_is_killed(rig, process) -> None:
    volts_per_g = 5e-3 / 9.80665
    source = rig.make_source(address=hear(process)["address"])
    source.configure(
        rig.make_plan(hammer_sensitivity=volts_per_g, specimen_sensitivity=volts_per_g)
    )
    for impact in (1, 2):
        source.arm()
        say(process, "strike")
        block = source.read(10.0)
        strike = hear(process)
        assert strike["impact"] == impact
        # The record is complete when its last point is: 1.7 ms after the trigger.
        assert block.stamp * 1e-9 + 2e-3 == pytest.approx(strike["complete"], abs=2.0)
        blocks = [block]
        while not blocks[-1].last:
            blocks.append(source.read(1.0))
        assert sum(block.hammer.output.size for block in blocks) == 5000
    source.arm()
    process.kill()
    with pytest.raises(DeviceError, match="closed the connection"):
        source.read(10.0)
    source.close()


def test_the_process_comes_and_goes_and_ends_when_it_is_told(rig, process) -> None:
    source = rig.make_source(address=hear(process)["address"])
    source.configure(rig.make_plan())
    say(process, "unplug")
    with pytest.raises(DeviceError, match="closed the connection"):
        source.read(10.0)
    source.close()
    say(process, "plug")
    say(process, "strike")
    # It is plugged in again: nobody has armed it.
    assert hear(process) == {"impact": 1, "complete": None}
    source.configure(rig.make_plan())
    source.close()
    say(process, "quit")
    assert process.wait(10.0) == 0
