"""A relay on a serial port, spoken to over a real pseudo-terminal with a board at its end."""

import subprocess
import sys
import threading
from collections.abc import Iterator
from types import ModuleType
from typing import ClassVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impact_rig.configuration.toml_table import parse_toml_table
from impact_rig.core.errors import DeviceError, ParameterError
from impact_rig.devices.serial_relay import SerialRelay, make_frame
from impact_rig.testing.contract import HammerHolderContract, HolderBench
from impact_rig.testing.peers.serial_relay import SerialRelayPeer

PATIENCE = 20.0
TEXT = """
protocol = "text"
hold_command = "HOLD"
release_command = "RELEASE"
answer = "OK"
query_command = "STATE?"
holding_answer = "HOLDING"
released_answer = "RELEASED"
"""
ANSWERING = {"four-byte": "answers = true", "text": TEXT}


@pytest.fixture
def board() -> Iterator[SerialRelayPeer]:
    peer = SerialRelayPeer(lambda: None)
    peer.start()
    yield peer
    peer.stop()


def read_options(text):
    return parse_toml_table("[holder]\n" + text).take_table("holder")


def make_relay(port, keys=""):
    pytest.importorskip("serial", reason="the extra `serial` is not installed")
    return SerialRelay(read_options(f'port = "{port}"\n{keys}'))


@pytest.fixture
def relay(board):
    """Return a function that configures a relay with further keys."""
    relays = []

    def configure(keys=""):
        relays.append(make_relay(board.port, keys))
        relays[-1].configure()
        return relays[-1]

    yield configure
    for item in relays:
        item.close()


@pytest.mark.parametrize(
    ("channel", "operation", "frame"),
    [(1, 1, "a00101a2"), (1, 0, "a00100a1"), (2, 1, "a00201a3"), (1, 5, "a00105a6")],
)
def test_frames_are_those_of_the_boards_manual(channel, operation, frame):
    assert make_frame(channel, operation).hex() == frame


def test_a_magnet_that_holds_while_the_relay_is_on_is_switched_on():
    released = threading.Event()
    board = SerialRelayPeer(released.set, holds_on=True)
    board.start()
    try:
        assert not board.is_holding
        holder = make_relay(board.port, 'energized = "holds"\nanswers = true')
        holder.configure()
        assert board.is_holding
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


def test_who_else_holds_the_port_is_named(board):
    pytest.importorskip("serial", reason="the extra `serial` is not installed")
    code = (
        "import serial, sys; port = serial.Serial(sys.argv[1], exclusive=True);"
        "print('open', flush=True); sys.stdin.read()"
    )
    other = subprocess.Popen(
        [sys.executable, "-c", code, board.port],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert other.stdout.readline() == "open\n"
        with pytest.raises(DeviceError, match=rf"is in use by .*process {other.pid}\)"):
            make_relay(board.port).configure()
    finally:
        other.communicate("", timeout=PATIENCE)
    holder = make_relay(board.port)
    assert "relay at" in holder.configure()
    holder.close()


@pytest.mark.parametrize("keys", ANSWERING.values(), ids=ANSWERING)
@pytest.mark.parametrize(
    ("distort", "word"),
    [
        (lambda answer: b"", "did not answer within 0.4 s"),
        (lambda answer: answer[:2], "answered half"),
        (lambda answer: b"\xff\x00\x80\n", "it must answer"),
        (lambda answer: b"\xff" * 300, "it must answer"),
    ],
    ids=["silence", "half an answer", "nonsense", "no end"],
)
def test_an_answer_that_is_none_is_told(board, keys, distort, word):
    holder = make_relay(board.port, keys)
    board.distort = distort
    with pytest.raises(DeviceError, match=word):
        holder.configure()
    board.distort = lambda answer: answer
    holder.configure()
    holder.close()


@pytest.mark.parametrize("keys", ANSWERING.values(), ids=ANSWERING)
def test_whatever_a_board_says_is_an_answer_or_an_error_in_words(board, keys, monkeypatch):
    monkeypatch.setattr("impact_rig.devices.serial_relay.ANSWER_TIMEOUT", 0.01)
    holder = make_relay(board.port, keys)

    @settings(max_examples=40)
    @given(said=st.binary(max_size=600) | st.sampled_from([b"OK\n", b"OK\nHOLDING\n"]))
    def check(said):
        board.distort = lambda _: said
        error = ""
        try:
            holder.configure()
        except DeviceError as raised:
            error = str(raised)
        assert not error or board.port in error

    check()
    holder.close()


def test_another_package_that_is_called_serial_is_not_taken_for_pyserial(monkeypatch):
    monkeypatch.setitem(sys.modules, "serial", ModuleType("serial"))
    for name in ("serial.tools", "serial.tools.list_ports"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    with pytest.raises(ModuleNotFoundError, match=r"serial\.tools"):
        make_relay("/dev/ttyUSB0").configure()


@pytest.mark.parametrize("keys", ANSWERING.values(), ids=ANSWERING)
def test_a_relay_that_does_not_move_contradicts_what_it_was_told(board, relay, keys):
    holder = relay(keys)
    board.is_stuck = True

    def release_and_look():
        holder.release()
        holder.read_state()

    with pytest.raises(DeviceError, match="says that it is holding, though it was told to be rel"):
        release_and_look()


@pytest.mark.parametrize(
    ("keys", "word"),
    [
        ("", "lacks port"),
        ('port = "a"\nchannel = 0', "line 3: channel .* between 1 and 16"),
        ('port = "a"\nenergised = "holds"', "did you mean 'energized'"),
        ('port = "a"\nenergized = "on"', "one of releases, holds"),
        ('port = "a"\nprotocol = "modbus"', "one of four-byte, text"),
        ('port = "a"\nprotocol = "text"\nhold_command = "H"', "lacks release_command"),
        (
            'port = "a"\nprotocol = "text"\nhold_command = "H"\nrelease_command = "H"',
            "line 5: .* another one than hold_command",
        ),
        (
            'port = "a"\nprotocol = "text"\nhold_command = "H\\n"\nrelease_command = "R"',
            "one line of ASCII text",
        ),
        (f'port = "a"{TEXT}channel = 1', "unknown key 'channel'"),
        (f'port = "a"{TEXT}line_end = ""', "what ends a line"),
        (
            f'port = "a"{TEXT}'.replace('"RELEASED"', '"HOLDING"'),
            "another one than holding_answer",
        ),
    ],
)
def test_a_key_that_cannot_be_meant_is_named_with_its_line(keys, word):
    with pytest.raises(ParameterError, match=word):
        SerialRelay(read_options(keys))


class RelayBench(HolderBench):
    """A board at the other end of a pseudo-terminal."""

    def __init__(self, keys: str) -> None:
        self._keys = keys
        self._releases = 0
        self._board = SerialRelayPeer(self._count)

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
    keys = TEXT
