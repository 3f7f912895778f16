"""The driver `scpi`: records as they went in, faults, options, contract."""

import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from fakes.scpi_digitizer import ScpiDigitizer

pytest.importorskip("pyvisa_py", reason="the extra `scpi` is not installed")

from impact_rig.configuration.toml_table import TomlTable, parse_toml_table
from impact_rig.core.given.errors import DeviceError, ParameterError
from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.sensors import Sensor
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.devices.protocols import AcquisitionPlan, SourceChannel
from impact_rig.devices.scpi import Instrument, ScpiSource
from impact_rig.devices.virtual.rig import VirtualHit, VirtualRig, VirtualRigSettings
from impact_rig.testing import AccelerationSourceContract, Applied, SourceBench

SENSITIVITIES = {"hammer": 5e-4, "specimen": -2.5e-4}
"""[V per m/s^2]: one count of a hit is a whole number of the instrument's."""
NUMBERS = {"hammer": "1", "specimen": "2"}
SAMPLE = "aluminium large"


class ScpiRig(SourceBench):
    """An instrument and what is around it."""

    driver = ScpiSource
    applied = Applied(hammer=810.0, specimen=-693.0, width=106e-6)  # of the virtual rig

    def __init__(self) -> None:
        self.digitizer = ScpiDigitizer(*SENSITIVITIES.values())
        self.unplug, self.plug = self.digitizer.unplug, self.digitizer.plug
        self._rig = VirtualRig(PAPER_SETUP, VirtualRigSettings())
        self._impacts = count(1)
        self.sources = []

    def make_hit(self) -> VirtualHit:
        return self._rig.strike(HitLabel(SAMPLE, impact=next(self._impacts)))

    def strike(self, source: object = None) -> VirtualHit:
        hit = self.make_hit()
        assert self.digitizer.feed(hit)
        return hit

    def make_source(self, address: str = "", timeout: float = ScpiSource.timeout) -> ScpiSource:
        """Return the source of a rig file whose [source] has an address."""
        source = ScpiSource(self.parse(f'address = "{address or self.digitizer.address}"'))
        source.timeout = timeout
        self.sources.append(source)
        return source

    def make_plan(self, text: str = "", numbers=NUMBERS, sign=1.0, **changes) -> AcquisitionPlan:
        """Return the plan of a rig file whose [source] has a text and these channels."""
        table = self.parse(text)
        channels = {
            name: SourceChannel(
                number,
                Sensor(name, sensitivity=sign * SENSITIVITIES[name]),
                options=table.take_table(name).without("channel"),
            )
            for name, number in numbers.items()
        }
        values = {"specimen": None, **channels, **changes}
        return AcquisitionPlan(
            **{"sampling_rate": 2.5e6, "record_duration": 2e-3, "pre_trigger": 3e-4,
               "trigger_level": 49.0, **values}
        )  # fmt: skip

    @staticmethod
    def parse(text: str) -> TomlTable:
        return parse_toml_table(f"[source]\n{text}").take_table("source")

    @staticmethod
    def find_counts(hit: VirtualHit, name: str) -> np.ndarray:
        """Return what a 14-bit converter of 1 V makes of a channel of a hit."""
        channel = getattr(hit, name)
        steps = channel.scale * SENSITIVITIES[name] * 2**13
        assert steps == pytest.approx(round(steps))
        return np.clip(channel.output * round(steps), -(2**13), 2**13 - 1)


@pytest.fixture
def rig() -> Iterator[ScpiRig]:
    rig = ScpiRig()
    rig.digitizer.plug()
    yield rig
    for source in rig.sources:
        source.close()
    rig.digitizer.unplug()


LEVEL = 49.0 * 5e-4 * 2**13
"""The trigger's, in counts."""


def read_record(source):
    block = source.read(5.0)
    assert block.last
    return block


def take_record(rig, source):
    source.arm()
    # As a swing does, and long enough for the whole ring to be written.
    time.sleep(0.01)
    hit = rig.strike()
    return hit, read_record(source)


def find_crossing(counts: np.ndarray, level: float) -> int:
    return int(np.argmax(counts >= level))


def test_each_count_of_a_record_is_that_of_the_input_with_the_trigger_in_its_place(rig):
    source = rig.make_source()
    source.configure(rig.make_plan())
    for _ in range(3):
        hit, block = take_record(rig, source)
        fed = rig.find_counts(hit, "hammer")
        shift = 750 - find_crossing(fed, LEVEL)
        for name in ("hammer", "specimen"):
            counts = getattr(block, name).output
            assert counts.size == 5000
            fed = rig.find_counts(hit, name)[: 5000 - shift]
            np.testing.assert_array_equal(counts[shift:], fed)


def test_nothing_of_the_record_before_stands_before_the_trigger(rig):
    source = rig.make_source()
    source.configure(rig.make_plan(record_duration=6e-3, pre_trigger=5e-3))
    for _ in range(3):
        hit = rig.make_hit()
        source.arm()
        rig.digitizer.feed(hit)
        counts = read_record(source).hammer.output
        shift = 12_500 - find_crossing(rig.find_counts(hit, "hammer"), LEVEL)
        # The quiet input, and not the pulse that the ring still holds.
        assert np.abs(counts[:shift]).max() < LEVEL


def test_a_hit_without_its_sample_has_the_hammer_alone(rig):
    source = rig.make_source()
    source.configure(rig.make_plan(numbers={"hammer": "1"}, specimen=None))
    _, block = take_record(rig, source)
    assert (block.hammer.output.size, block.specimen.output.size) == (5000, 0)


def test_an_input_beyond_its_range_is_flagged_in_its_channel(rig):
    source = rig.make_source()
    source.configure(rig.make_plan())
    source.arm()
    hit = rig.make_hit()
    rig.digitizer.feed(replace(hit, hammer=replace(hit.hammer, scale=3 * hit.hammer.scale)))
    block = read_record(source)
    assert (block.hammer.overloaded, block.specimen.overloaded) == (True, False)
    assert block.hammer.output.max() == 2**13 - 1
    assert block.hammer.full_scale == pytest.approx(1.0 / 5e-4)


def test_a_sensor_that_looks_the_other_way_triggers_on_the_falling_voltage(rig):
    hit = rig.make_hit()
    hit = replace(hit, hammer=replace(hit.hammer, scale=-hit.hammer.scale))
    source = rig.make_source()
    source.configure(rig.make_plan(sign=-1.0))
    source.arm()
    assert rig.digitizer.feed(hit)
    block = read_record(source)
    assert block.hammer.acceleration.max() > 49.0


def test_the_wide_range_has_larger_counts(rig):
    source = rig.make_source()
    source.configure(rig.make_plan('[source.hammer]\nrange = "20 V"'))
    hit, block = take_record(rig, source)
    assert block.hammer.scale == pytest.approx(20 * block.specimen.scale * -0.5)
    found, struck = (item.hammer.acceleration for item in (block, hit))
    assert found.max() == pytest.approx(struck.max(), abs=block.hammer.scale)


def test_the_stamp_is_that_of_the_first_point(rig):
    source = rig.make_source()
    source.configure(rig.make_plan())
    before = time.time_ns()
    source.arm()
    rig.strike()
    block = read_record(source)
    # The trigger is known as well as the instrument is asked often, which a busy computer may
    # not do; the first point is 0.3 ms before it.
    assert before - 300_000 < block.stamp < time.time_ns() - 300_000


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('address = "10.0.0.1:x"', "line 2: address is '10.0.0.1:x'.*192.168.1.20:5000"),
        ('address = "a"\nboard = "125"', "line 3: board.*125-14, 125-10"),
    ],
)
def test_a_key_is_refused_by_its_line(rig, text, words):
    with pytest.raises(ParameterError, match=words):
        ScpiSource(rig.parse(text))


def test_an_address_is_a_host_with_a_port():
    assert Instrument("rp-f0a235.local").resource_name == "TCPIP::rp-f0a235.local::5000::SOCKET"
    assert Instrument("10.0.0.1:5025").resource_name == "TCPIP::10.0.0.1::5025::SOCKET"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sampling_rate": 2.4e6}, "2400000 Hz: the nearest rate of the board is 2403846.15 Hz"),
        ({"record_duration": 7e-3}, "17500 points is too long for the board, which holds 16384"),
        ({"trigger_level": 2000.0}, "trigger_level is 2000 m/s.2, which is 1 V at the input"),
        ({"numbers": {"hammer": "3"}}, "channel of .source.hammer. is 3: it must be one of 1, 2"),
        ({"numbers": {"hammer": "2", "specimen": "2"}}, "hammer and sample are both on channel 2"),
        ({"continuous": True}, "records single hits only: set mode to triggered"),
        ({"text": '[source.hammer]\nrange = "2 V"'}, 'line 3: range .* "1 V" or "20 V"'),
    ],
)  # fmt: skip
def test_a_plan_that_the_board_cannot_do_is_refused(rig, changes, words):
    with pytest.raises(ParameterError, match=words):
        rig.make_source().configure(rig.make_plan(**changes))


TIMEOUT = 0.3
LATE = 3.0
"""How much later a call may return on a busy computer [s]."""


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


def test_another_instrument_is_named_by_what_it_says_it_is(rig):
    rig.digitizer.board.identity = "RIGOL TECHNOLOGIES,DS1054Z,DS1ZA0,00.04.04"
    with refusal("is 'RIGOL TECHNOLOGIES,DS1054Z", "must contain 'REDPITAYA'"):
        rig.make_source().configure(rig.make_plan())


def test_an_instrument_in_other_hands_is_named(rig):
    rig.digitizer.is_busy = True
    with refusal("does another program hold it|another program holds it"):
        rig.make_source(timeout=TIMEOUT).configure(rig.make_plan())


def test_an_address_that_no_instrument_has_is_named(rig):
    with refusal("cannot be reached: "):
        rig.make_source("a" * 70, TIMEOUT).configure(rig.make_plan())


def test_settings_that_another_program_has_changed_are_noticed_at_the_next_arming(rig):
    source = rig.make_source()
    source.configure(rig.make_plan())
    source.arm()
    rig.digitizer.board.answer("ACQ:SOUR2:GAIN HV")
    with refusal("was set: is it the right board, and does another program talk to it, too"):
        source.arm()


def cut_in_half(answer):
    return answer[: (len(answer) + 1) // 2]


@pytest.mark.parametrize(
    ("query", "spoil", "words"),
    [
        ("*IDN?", lambda _: b"", "does not answer"),
        ("ACQ:DEC:FACTOR?", lambda _: b"64\r\n", "to ACQ:DEC:FACTOR., where 50 was set"),
        ("ACQ:TRIG:STAT?", cut_in_half, "does not answer"),
        ("ACQ:SOUR2:DATA", cut_in_half, "does not answer"),
        ("ACQ:SOUR1:DATA", lambda _: b"{1,2,3}\r\n", "ACQ:SOUR1:DATA:START:N.* begins no block"),
        ("ACQ:SOUR1:DATA", lambda _: b"#41000", "ACQ:SOUR1:DATA:START:N.* a block of 1000 bytes"),
    ],
)
def test_a_wrong_answer_to_any_question_is_named_and_the_next_try_works(rig, query, spoil, words):
    rig.digitizer.spoil = lambda line, answer: spoil(answer) if line.startswith(query) else answer
    source = rig.make_source(timeout=TIMEOUT)
    with refusal(re.escape(rig.digitizer.address), words):
        source.configure(rig.make_plan())
        take_record(rig, source)
    source.close()
    rig.digitizer.spoil = lambda _, answer: answer
    source.configure(rig.make_plan())
    assert take_record(rig, source)[1].hammer.output.size == 5000


class TestScpiSource(AccelerationSourceContract):
    """The contract, on a peer that speaks SCPI."""

    @pytest.fixture
    def bench(self, rig) -> "ScpiRig":
        return rig
