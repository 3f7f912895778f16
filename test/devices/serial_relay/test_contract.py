"""What every holder does, done by a relay on a serial port in each way it may be spoken to."""

from typing import ClassVar

import pytest

from impact_rig.configuration.toml_table import parse_toml_table
from impact_rig.devices.contract.benches import HolderBench
from impact_rig.devices.contract.holder_contract import HammerHolderContract
from impact_rig.devices.peers.serial_relay import SerialRelayPeer
from impact_rig.devices.serial_relay.holder import SerialRelay


class RelayBench(HolderBench):
    """A board at the other end of a pseudo-terminal."""

    def __init__(self, keys: str) -> None:
        self._keys = keys
        self._releases = 0
        self._board = SerialRelayPeer(self._count)

    def _count(self) -> None:
        self._releases += 1

    def __enter__(self):
        self._board.start()
        return self

    def __exit__(self, kind, error, trace):
        self._board.stop()

    def get_driver(self):
        return SerialRelay

    def make_holder(self):
        text = f'[holder]\nport = "{self._board.port}"\n{self._keys}'
        return SerialRelay(parse_toml_table(text).take_table("holder"))

    def is_holding(self):
        return self._board.is_holding

    def count_releases(self):
        return self._releases

    def unplug(self):
        self._board.unplug()

    def plug(self):
        self._board.plug()


class TestSerialRelay(HammerHolderContract):
    keys: ClassVar[str] = ""

    @pytest.fixture
    def bench(self):
        with RelayBench(self.keys) as bench:
            yield bench


class TestSerialRelayThatAnswers(TestSerialRelay):
    keys = "answers = true"


class TestSerialRelayWithText(TestSerialRelay):
    keys = """
        protocol = "text"
        hold_command = "HOLD"
        release_command = "RELEASE"
        answer = "OK"
        query_command = "STATE?"
        holding_answer = "HOLDING"
        released_answer = "RELEASED"
    """
