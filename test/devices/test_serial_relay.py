"""A relay on a serial port, spoken to over a real pseudo-terminal with a board at its end."""

import threading
import time
from collections.abc import Iterator

import pytest
from fakes.relay_board import RelayBoard

from impact_rig.configuration.toml_table import parse_toml_table
from impact_rig.core.errors import DeviceError, ParameterError
from impact_rig.devices.serial_relay import SerialRelay, make_frame
from impact_rig.testing import HammerHolderContract, HolderBench

PATIENCE = 20.0


@pytest.fixture
def board() -> Iterator[RelayBoard]:
    peer = RelayBoard(lambda: None)
    peer.start()
    yield peer
    peer.stop()


def wait_until(condition):
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def read_options(text):
    return parse_toml_table("[holder]\n" + text).take_table("holder")


def make_relay(port, keys=""):
    pytest.importorskip("serial", reason="the extra `serial` is not installed")
    return SerialRelay(read_options(f'port = "{port}"\n{keys}'))


@pytest.mark.parametrize(
    ("channel", "operation", "frame"),
    [(1, 1, "a00101a2"), (1, 0, "a00100a1"), (2, 1, "a00201a3")],
)
def test_frames_are_those_of_the_boards_manual(channel, operation, frame):
    assert make_frame(channel, operation).hex() == frame


def test_a_magnet_that_holds_while_the_relay_is_on_is_switched_on():
    released = threading.Event()
    board = RelayBoard(released.set, holds_on=True)
    board.start()
    try:
        assert not board.is_holding
        holder = make_relay(board.port, 'energized = "holds"')
        holder.configure()
        wait_until(lambda: board.is_holding)
        holder.release()
        assert released.wait(PATIENCE)
        holder.close()
    finally:
        board.stop()


def test_a_file_that_is_no_serial_port_is_named(tmp_path):
    path = tmp_path / "file"
    path.touch()
    with pytest.raises(DeviceError, match="cannot be used as a serial port"):
        make_relay(path).configure()


def test_a_port_that_another_program_has_is_named(board):
    first, second = make_relay(board.port), make_relay(board.port)
    first.configure()
    with pytest.raises(DeviceError, match="is in use by another program: end it first"):
        second.configure()
    first.close()
    second.configure()
    second.close()


@pytest.mark.parametrize(
    ("keys", "word"),
    [
        ("", "lacks port"),
        ('port = "a"\nchannel = 0', "line 3: channel .* between 1 and 16"),
        ('port = "a"\nenergised = "holds"', "did you mean 'energized'"),
        ('port = "a"\nenergized = "on"', "one of releases, holds"),
    ],
)
def test_a_key_that_cannot_be_meant_is_named_with_its_line(keys, word):
    with pytest.raises(ParameterError, match=word):
        SerialRelay(read_options(keys))


class RelayBench(HolderBench):
    """A board at the other end of a pseudo-terminal."""

    def __init__(self) -> None:
        self._releases = 0
        self._board = RelayBoard(self._count)

    def _count(self) -> None:
        self._releases += 1

    def __enter__(self):
        pytest.importorskip("serial", reason="the extra `serial` is not installed")
        self._board.start()
        return self

    def __exit__(self, kind, error, trace):
        self._board.stop()

    def get_driver(self):
        return SerialRelay

    def make_holder(self):
        text = f'[holder]\nport = "{self._board.port}"'
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
    @pytest.fixture
    def bench(self):
        with RelayBench() as bench:
            yield bench
