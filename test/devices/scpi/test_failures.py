"""Whatever an instrument does instead of its duty is said in one sentence, in time."""

import re
import time
from contextlib import contextmanager

import pytest

from impact_rig.core.errors import DeviceError
from impact_rig.devices.peers.line_server import LineServer
from impact_rig.devices.peers.scpi_digitizer import ScpiFault
from impact_rig.devices.scpi.connection import ScpiConnection

TIMEOUT = 0.1
LATE = 3.0
"""How much later a call may return on a busy computer [s]."""
QUICK = f'timeout = "{TIMEOUT} s"'

QUERIES = (
    "*IDN?",
    "ACQ:DEC:FACTOR?",
    "ACQ:TRIG:STAT?",
    "ACQ:TRIG:FILL?",
    "ACQ:TPOS?",
    "ACQ:SOUR2",
)
WORDS = {
    ScpiFault.SILENT: "does not answer",
    ScpiFault.HALF: "has sent half of its answer to",
    ScpiFault.CUT: "closed? the connection|closes the connection",
    ScpiFault.NONSENSE: "should come",
}


def take_record(rig, source):
    source.configure(rig.make_plan())
    source.arm()
    rig.strike()
    blocks = [source.read(5.0)]
    while not blocks[-1].last:
        blocks.append(source.read(5.0))
    return blocks


@contextmanager
def refusal(*words: str):
    """Expect a DeviceError of one sentence that matches these words, in time."""
    begin = time.monotonic()
    with pytest.raises(DeviceError) as found:
        yield
    assert time.monotonic() - begin < TIMEOUT + LATE
    text = str(found.value)
    assert "\n" not in text
    for word in words:
        assert re.search(word, text), text


@pytest.mark.parametrize("fault", WORDS, ids=lambda fault: fault.name.lower())
@pytest.mark.parametrize("query", QUERIES)
def test_a_wrong_answer_to_any_question_is_named_and_the_next_try_works(
    rig, fault: ScpiFault, query: str
) -> None:
    source = rig.make_source(QUICK)
    rig.digitizer.misbehave(fault, query)
    with refusal(re.escape(rig.digitizer.address), WORDS[fault]):
        take_record(rig, source)
    source.close()
    rig.digitizer.misbehave(ScpiFault.NONE)
    assert len(take_record(rig, source)) == 5
    source.close()


def test_half_a_record_is_none(rig) -> None:
    source = rig.make_source(QUICK)
    rig.digitizer.misbehave(ScpiFault.HALF, "DATA:START")
    with refusal("half of its answer to ACQ:SOUR1:DATA"):
        take_record(rig, source)
    source.close()


def test_another_instrument_is_named_by_what_it_says_it_is(rig) -> None:
    rig.digitizer.set_identity("RIGOL TECHNOLOGIES,DS1054Z,DS1ZA0,00.04.04")
    with refusal("is 'RIGOL TECHNOLOGIES,DS1054Z", "must contain 'REDPITAYA'"):
        rig.make_source().configure(rig.make_plan())
    source = rig.make_source('identity = "ds1054z"')
    assert "DS1054Z" in source.configure(rig.make_plan()).identity
    source.close()


def test_an_instrument_in_other_hands_is_named(rig) -> None:
    rig.digitizer.set_busy(is_busy=True)
    with refusal("another program may hold it"):
        rig.make_source().configure(rig.make_plan())
    rig.digitizer.set_busy(is_busy=False)
    source = rig.make_source()
    source.configure(rig.make_plan())
    source.close()


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("192.0.2.1:5000", "at 192.0.2.1:5000 (does not answer|cannot be reached|refuses)"),
        ("a" * 70, "cannot be reached: .*label"),
    ],
)
def test_an_address_where_nobody_is_is_named(rig, address: str, words: str) -> None:
    with refusal(words):
        rig.make_source(QUICK, address).configure(rig.make_plan())


def test_an_instrument_without_its_server_is_named(rig) -> None:
    rig.digitizer.unplug()
    with refusal("refuses connections: start its SCPI server"):
        rig.make_source().configure(rig.make_plan())


@pytest.mark.parametrize("is_armed", [True, False])
def test_a_loss_is_noticed_whether_it_is_armed_or_not(rig, is_armed: bool) -> None:
    source = rig.make_source()
    source.configure(rig.make_plan())
    if is_armed:
        source.arm()
    rig.digitizer.unplug()
    with refusal("closed the connection"):
        source.read(TIMEOUT)
    source.close()


@contextmanager
def serve(answer):
    """Serve an instrument that answers as a function says."""
    server = LineServer(lambda line: (answer(line.decode().strip()), True))
    server.open()
    try:
        yield server.address
    finally:
        server.close()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"REDPITAYA\r\n7\r\n", "answers '7.r.n' to nothing: silence should come"),
        (b"REDPITAYA \x07\r\n", "a line of text should come"),
        (b"R" * 5000, "a line of text should come"),
        ("REDPITAYÄ\r\n".encode(), "a line of text should come"),
    ],
)
def test_who_says_too_much_is_named(rig, text: bytes, words: str) -> None:
    with serve(lambda line: text if line == "*IDN?" else b"") as address, refusal(words):
        rig.make_source(QUICK, address).configure(rig.make_plan())


def test_an_instrument_that_does_not_obey_is_named(rig) -> None:
    def answer(line: str) -> bytes:
        return {"*IDN?": b"RedPitaya 9\n", "ACQ:DEC:FACTOR?": b"64\n"}.get(line, b"")

    words = "does not obey ACQ:DEC:FACTOR 50: it answers '64'"
    with serve(answer) as address, refusal(words):
        rig.make_source(QUICK, address).configure(rig.make_plan())


@pytest.mark.parametrize("command", ["ACQ:DEC:FACTOR 64", "ACQ:SOUR2:GAIN HV", "ACQ:RST"])
def test_settings_that_another_program_has_changed_are_noticed_at_the_next_arming(
    rig, command: str
) -> None:
    source = rig.make_source()
    source.configure(rig.make_plan())
    source.arm()
    host, port = rig.digitizer.address.split(":")
    other = ScpiConnection(host, int(port), TIMEOUT)
    other.send(command)
    assert other.ask("*OPC?") == "1"
    other.close()
    with refusal("was set: another program talks to it, too"):
        source.arm()
    source.close()


@pytest.mark.parametrize(
    "block", [b"#0", b"#x12", b"{1,2,3}\n", b"#3ab", b"#9999999999", b"#41000"]
)
def test_what_is_no_block_of_the_record_is_named(rig, block: bytes) -> None:
    rig.digitizer.stop()
    board = rig.digitizer._board

    def answer(line: str) -> bytes:
        if "DATA:START" in line:
            return block
        found = board.answer(line)
        if line.startswith("ACQ:TRIG CH"):
            rig.strike()
        return b"" if found is None else found + b"\n"

    with serve(answer) as address:
        source = rig.make_source(QUICK, address)
        source.configure(rig.make_plan())
        source.arm()
        with refusal("to ACQ:SOUR1:DATA:START:N"):
            source.read(5.0)
        source.close()


def test_a_source_that_is_not_configured_says_so(rig) -> None:
    source = rig.make_source()
    with pytest.raises(DeviceError, match="not configured"):
        source.arm()
    with pytest.raises(DeviceError, match="not configured"):
        source.read(0.0)
