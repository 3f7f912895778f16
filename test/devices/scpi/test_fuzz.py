"""Random bytes instead of answers: an error in words, or a record, and always an end."""

from contextlib import closing, contextmanager, suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.errors import DeviceError
from impact_rig.core.setup.sensors import Sensor
from impact_rig.devices.acceleration_source import AcquisitionPlan, SourceChannel
from impact_rig.devices.peers.line_server import LineServer
from impact_rig.devices.peers.red_pitaya import RedPitaya
from impact_rig.devices.scpi.connection import ScpiConnection
from impact_rig.devices.scpi.source import ScpiSource

EXAMPLES = settings(max_examples=150, deadline=None)
TIMEOUT = 0.05
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


@contextmanager
def serve(answer):
    """Serve an instrument that answers as a function says."""
    server = LineServer(lambda line: answer(line.decode().strip()))
    server.open()
    try:
        host, port = server.address.split(":")
        yield host, int(port)
    finally:
        server.close()


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
def test_no_answer_breaks_the_connection_but_in_words(answers) -> None:
    script = iter(answers)

    def answer(_: str) -> tuple[bytes, bool]:
        # An answer may be the last one, with and without an end.
        data, goes_on = next(script, (b"", False))
        return data, goes_on and data.endswith(b"\n")

    with serve(answer) as address:
        connection = ScpiConnection(*address, TIMEOUT)
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
    place: int, begin: int, length: int, patch: bytes, goes_on: bool
) -> None:
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

    with serve(answer) as (host, port):
        source = ScpiSource(
            TomlTable({"address": f"{host}:{port}", "timeout": f"{TIMEOUT} s"}, "[source]")
        )
        with closing(source), suppress(DeviceError):
            source.configure(PLAN)
            source.arm()
            block = source.read(1.0)
            assert block is None or (block.last and block.hammer.output.size == POINTS)


def test_the_same_dialogue_unspoilt_gives_the_record() -> None:
    board = RedPitaya()

    def answer(line: str) -> tuple[bytes, bool]:
        found = board.answer(line)
        if line.startswith("ACQ:TRIG CH"):
            board.strike(PULSE, 125e6)
        return b"" if found is None else found + b"\n", True

    with serve(answer) as (host, port):
        source = ScpiSource(TomlTable({"address": f"{host}:{port}"}, "[source]"))
        source.configure(PLAN)
        source.arm()
        block = source.read(5.0)
        assert block.hammer.output.tolist() == [0] * 16 + [4096] * 48
        assert block.hammer.scale * 4096 == pytest.approx(500.0)
        source.close()
