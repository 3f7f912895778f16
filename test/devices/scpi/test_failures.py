"""Whatever an instrument does instead of its duty is said in one sentence, in time."""

import re
import time
from contextlib import closing, contextmanager, suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.errors import DeviceError
from impact_rig.core.setup.sensors import Sensor
from impact_rig.devices.protocols import AcquisitionPlan, SourceChannel
from impact_rig.devices.scpi.source import ScpiConnection, ScpiSource
from impact_rig.testing.peers.scpi_digitizer import LineServer, RedPitaya, ScpiFault

TIMEOUT = 0.3
LATE = 3.0
"""How much later a call may return on a busy computer [s]."""
QUICK = f'timeout = "{TIMEOUT} s"'

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


@pytest.mark.parametrize(
    ("fault", "query"),
    [
        (ScpiFault.SILENT, "*IDN?"),
        (ScpiFault.HALF, "ACQ:TRIG:STAT?"),
        (ScpiFault.CUT, "ACQ:SOUR2"),
        (ScpiFault.NONSENSE, "ACQ:SOUR2"),
    ],
)
def test_a_wrong_answer_to_any_question_is_named_and_the_next_try_works(rig, fault, query):
    source = rig.make_source(QUICK)
    rig.digitizer.misbehave(fault, query)
    with refusal(re.escape(rig.digitizer.address), WORDS[fault]):
        take_record(rig, source)
    source.close()
    rig.digitizer.misbehave(ScpiFault.NONE)
    with closing(rig.make_source()) as again:
        assert take_record(rig, again)[0].hammer.output.size == 5000


def test_another_instrument_is_named_by_what_it_says_it_is(rig):
    rig.digitizer.set_identity("RIGOL TECHNOLOGIES,DS1054Z,DS1ZA0,00.04.04")
    with refusal("is 'RIGOL TECHNOLOGIES,DS1054Z", "must contain 'REDPITAYA'"):
        rig.make_source().configure(rig.make_plan())
    source = rig.make_source('identity = "ds1054z"')
    assert "DS1054Z" in source.configure(rig.make_plan()).identity


def test_an_instrument_in_other_hands_is_named(rig):
    rig.digitizer.set_busy(is_busy=True)
    with refusal("another program may hold it"):
        rig.make_source().configure(rig.make_plan())
    rig.digitizer.set_busy(is_busy=False)
    source = rig.make_source()
    source.configure(rig.make_plan())


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("192.0.2.1:5000", "at 192.0.2.1:5000 (does not answer|cannot be reached|refuses)"),
        ("a" * 70, "cannot be reached: .*label"),
    ],
)
def test_an_address_where_nobody_is_is_named(rig, address, words):
    with refusal(words):
        rig.make_source(QUICK, address).configure(rig.make_plan())


def test_an_instrument_without_its_server_is_named(rig):
    rig.digitizer.unplug()
    with refusal("refuses connections: start its SCPI server"):
        rig.make_source().configure(rig.make_plan())


@pytest.mark.parametrize("is_armed", [True, False])
def test_a_loss_is_noticed_whether_it_is_armed_or_not(rig, is_armed):
    source = rig.make_source()
    source.configure(rig.make_plan())
    if is_armed:
        source.arm()
    rig.digitizer.unplug()
    with refusal("closed the connection"):
        source.read(TIMEOUT)


@contextmanager
def serve(answer):
    """Serve an instrument that answers as a function says: with bytes, and whether it goes on."""
    server = LineServer(lambda line: answer(line.decode().strip()))
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
def test_who_says_too_much_is_named(rig, text, words):
    with serve(lambda line: (text if line == "*IDN?" else b"", True)) as address, refusal(words):
        rig.make_source(QUICK, address).configure(rig.make_plan())


def test_an_instrument_that_does_not_obey_is_named(rig):
    def answer(line: str) -> tuple[bytes, bool]:
        return {"*IDN?": b"RedPitaya 9\n", "ACQ:DEC:FACTOR?": b"64\n"}.get(line, b""), True

    words = "does not obey ACQ:DEC:FACTOR 50: it answers '64'"
    with serve(answer) as address, refusal(words):
        rig.make_source(QUICK, address).configure(rig.make_plan())


@pytest.mark.parametrize("command", ["ACQ:DEC:FACTOR 64", "ACQ:SOUR2:GAIN HV", "ACQ:RST"])
def test_settings_that_another_program_has_changed_are_noticed_at_the_next_arming(rig, command):
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


@pytest.mark.parametrize(
    "block", [b"#0", b"#x12", b"{1,2,3}\n", b"#3ab", b"#9999999999", b"#41000"]
)
def test_what_is_no_block_of_the_record_is_named(rig, block):
    rig.digitizer.unplug()
    board = rig.digitizer._board

    def answer(line: str) -> tuple[bytes, bool]:
        if "DATA:START" in line:
            return block, True
        found = board.answer(line)
        if line.startswith("ACQ:TRIG CH"):
            rig.strike()
        return b"" if found is None else found + b"\n", True

    with serve(answer) as address:
        source = rig.make_source(QUICK, address)
        source.configure(rig.make_plan())
        source.arm()
        with refusal("to ACQ:SOUR1:DATA:START:N"):
            source.read(5.0)
        source.close()


EXAMPLES = settings(max_examples=50, deadline=None)
FUZZ_TIMEOUT = 0.05
POINTS = 64
PLAN = AcquisitionPlan(
    sampling_rate=125e6,
    record_duration=POINTS / 125e6,
    pre_trigger=16 / 125e6,
    trigger_level=100.0,
    hammer=SourceChannel("1", Sensor("hammer", sensitivity=1e-3)),
    specimen=SourceChannel("2", Sensor("specimen", sensitivity=1e-3)),
)
PULSE = np.stack([np.r_[np.zeros(100), np.full(100, 0.5), np.zeros(100)]] * 2)


ANSWERS = st.one_of(
    st.binary(max_size=40),
    st.text("#0123456789{},.-eEnaif \r\n", max_size=40).map(str.encode),
    st.builds(
        lambda size, data, end: b"#%d%d" % (len(str(size)), size) + data + end,
        st.integers(0, 20), st.binary(max_size=20), st.sampled_from([b"\n", b"\r\n", b""]),
    ),
)  # fmt: skip


@EXAMPLES
@given(st.lists(st.tuples(ANSWERS, st.booleans()), min_size=1, max_size=4))
def test_no_answer_breaks_the_connection_but_in_words(answers):
    script = iter(answers)

    def answer(_: str) -> tuple[bytes, bool]:
        # An answer may be the last one, with and without an end.
        data, goes_on = next(script, (b"", False))
        return data, goes_on and data.endswith(b"\n")

    with serve(answer) as address:
        host, port = address.split(":")
        connection = ScpiConnection(host, int(port), FUZZ_TIMEOUT)
        with closing(connection), suppress(DeviceError):
            for number in range(len(answers)):
                if number % 2:
                    assert len(connection.ask_block("B?", 16)) <= 16
                else:
                    assert connection.ask("T?").isprintable()


@EXAMPLES
@given(
    place=st.integers(0, 14),
    begin=st.integers(0, 300),
    length=st.integers(0, 300),
    patch=st.binary(max_size=12),
    goes_on=st.booleans(),
)
def test_a_spoilt_answer_gives_an_error_in_words_or_a_whole_record(
    place, begin, length, patch, goes_on
):
    board = RedPitaya()
    count = 0

    def answer(line: str) -> tuple[bytes, bool]:
        nonlocal count
        found = board.answer(line)
        if line.startswith("ACQ:TRIG CH"):
            board.strike(PULSE, 125e6)
        if found is None:
            return b"", True
        found += b"\r\n"
        count += 1
        if count != place + 1:
            return found, True
        first = min(begin, len(found))
        return found[:first] + patch + found[first + length :], goes_on

    with serve(answer) as address:
        options = {"address": address, "timeout": f"{FUZZ_TIMEOUT} s"}
        source = ScpiSource(TomlTable(options, "[source]"))
        with closing(source), suppress(DeviceError):
            source.configure(PLAN)
            source.arm()
            block = source.read(1.0)
            if count <= place and block is not None:
                # Nothing was spoilt: every point is that of the pulse.
                assert block.hammer.output.tolist() == [0] * 16 + [4096] * 48
            assert block is None or (block.last and block.hammer.output.size == POINTS)
