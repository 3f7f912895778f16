"""The stand-in does what Red Pitaya's list of commands says, asked over a plain socket."""

import socket
import time
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.signals.record import ChannelBlock, HitLabel
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.testing.peers.scpi_digitizer import ScpiDigitizer

DEADLINE = 20.0


class Terminal:
    """A person with a terminal."""

    def __init__(self, address: str) -> None:
        host, port = address.split(":")
        self._socket = socket.create_connection((host, int(port)), DEADLINE)
        self._file = self._socket.makefile("rb")

    def say(self, *commands: str) -> None:
        self._socket.sendall("".join(f"{command}\r\n" for command in commands).encode())

    def ask(self, query: str) -> str:
        self.say(query)
        return self._file.readline().decode().removesuffix("\r\n")

    def ask_bytes(self, query: str, count: int) -> bytes:
        self.say(query)
        return self._file.read(count)

    def wait_for(self, query: str, answer: str) -> None:
        deadline = time.monotonic() + DEADLINE
        while self.ask(query) != answer:
            assert time.monotonic() < deadline

    def close(self) -> None:
        self._file.close()
        self._socket.close()


@pytest.fixture
def digitizer():
    instrument = ScpiDigitizer(1e-3, 2e-3)
    instrument.plug()
    yield instrument
    instrument.unplug()


@pytest.fixture
def terminal(digitizer):
    connection = Terminal(digitizer.address)
    yield connection
    connection.close()


def make_ramp(sign: int = 1):
    """Return a hit whose hammer rises by 1 m/s^2 a point, at 1 MS/s, from -100 to 400."""
    hit = VirtualRig(PAPER_SETUP, VirtualRigSettings()).strike(HitLabel("steel small"))
    ramp = ChannelBlock(np.arange(-100, 400, dtype=np.int32), float(sign), 0.0, 1000.0)
    return replace(hit, hammer=ramp, specimen=ramp, sampling_rate=1e6)


def test_what_it_does_not_understand_has_no_answer(terminal):
    terminal.say("ACQ:NONSENSE?", "ACQ:SOUR3:GAIN?", "ACQ:DEC:FACTOR 12", "ACQ:DEC:FACTOR x")
    assert terminal.ask("ACQ:DEC:FACTOR?") == "1"
    terminal.say("ACQ:SOUR1:GAIN XV", "ACQ:SOUR2:GAIN HV")
    assert [terminal.ask(f"ACQ:SOUR{n}:GAIN?") for n in (1, 2)] == ["LV", "HV"]


@pytest.mark.parametrize(("edge", "sign"), [("PE", 1), ("NE", -1)])
@pytest.mark.parametrize(("channel", "sensitivity"), [(1, 1e-3), (2, 2e-3)])
def test_the_trigger_is_the_first_point_beyond_its_level(
    digitizer, terminal, edge, sign, channel, sensitivity
):
    terminal.say("ACQ:DEC:FACTOR 125", "ACQ:DATA:UNITS RAW", f"ACQ:TRIG:LEV {sign * 0.1} V")
    # 100 points after the trigger.
    terminal.say("ACQ:TRIG:DLY -8092", "ACQ:START", f"ACQ:TRIG CH{channel}_{edge}")
    assert terminal.ask("ACQ:TRIG:STAT?") == "WAIT"
    assert digitizer.feed(make_ramp(sign)) is not None
    terminal.wait_for("ACQ:TRIG:FILL?", "1")
    assert terminal.ask("ACQ:TRIG:STAT?") == "TD"
    place = int(terminal.ask("ACQ:TPOS?"))
    assert (int(terminal.ask("ACQ:WPOS?")) - place) % 16384 == 100
    before = (place - 1) % 16384
    answer = terminal.ask(f"ACQ:SOUR{channel}:DATA:START:N? {before},3")
    values = [int(word) for word in answer.strip("{}").split(",")]
    first = round(0.1 / sensitivity)
    counts = [sign * sensitivity * value * 8192 for value in range(first - 1, first + 2)]
    assert values == pytest.approx(counts, abs=0.5)


def test_a_signal_that_never_was_below_the_level_does_not_trigger(digitizer, terminal):
    terminal.say("ACQ:DEC:FACTOR 125", "ACQ:TRIG:LEV -0.098", "ACQ:START", "ACQ:TRIG CH1_PE")
    terminal.ask("*OPC?")
    assert digitizer.feed(make_ramp()) is None


def test_it_vanishes_and_comes_back_where_it_was(digitizer, terminal):
    assert terminal.ask("*OPC?") == "1"
    terminal.say("ACQ:DEC:FACTOR 64")
    assert terminal.ask("ACQ:DEC:F?") == "64"
    address = digitizer.address
    digitizer.unplug()
    with pytest.raises(ConnectionError):
        Terminal(address)
    digitizer.plug()
    assert digitizer.address == address
    again = Terminal(address)
    assert again.ask("ACQ:DEC:F?") == "1"
    again.close()
