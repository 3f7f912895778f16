"""The drivers `nidaqmx` below NI's own library, with a device that is not there."""

import threading
import time
import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("nidaqmx", reason="the drivers need the Python package nidaqmx")

from fakes.ni_driver import FakeDriver, Interpreter
from nidaqmx import Task, utils
from nidaqmx.errors import DaqError, DaqNotFoundError, DaqReadError, DaqWarning
from nidaqmx.stream_writers import DigitalSingleChannelWriter

from impact_rig.configuration.rig_file import parse_rig_file, read_template
from impact_rig.configuration.toml_table import TomlTable, parse_toml_table
from impact_rig.core.errors import DeviceError, ParameterError, RigError
from impact_rig.core.records import HitLabel
from impact_rig.core.sensors import STANDARD_GRAVITY
from impact_rig.devices.drivers import COMMON_KEYS, HOLDERS, SOURCES
from impact_rig.devices.nidaqmx import NidaqmxHolder, NidaqmxSource, report_errors
from impact_rig.devices.protocols import HolderState
from impact_rig.devices.source_table import make_plan
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.testing import (
    AccelerationSourceContract,
    HammerHolderContract,
    HolderBench,
    SourceBench,
    check_sentence,
)

HAMMER_SENSITIVITY = 0.010 / 9.80665
SPECIMEN_SENSITIVITY = -0.005 / 9.80665
"""[V per m/s^2]; the sample's sensor looks the other way."""
SOURCE = """
[source]
driver = "nidaqmx"
sampling_rate = "2.5 MHz"
record_duration = "2 ms"
pre_trigger = "200 us"
trigger_level = "5 g"
[source.hammer]
channel = "Dev1/ai0"
sensitivity = "10 mV/g"
iepe_current = "4 mA"
range = "5 V"
{hammer}
[source.specimen]
channel = "Dev1/ai1"
sensitivity = "-5 mV/g"
iepe_current = "4 mA"
range = "5 V"
"""


@pytest.fixture
def driver(monkeypatch):
    """Return NI's driver as `nidaqmx` finds it."""
    driver = FakeDriver(HAMMER_SENSITIVITY, SPECIMEN_SENSITIVITY)
    monkeypatch.setattr(utils, "_select_interpreter", lambda *_: Interpreter(driver))
    return driver


@pytest.fixture(scope="session")
def hit():
    """Return a hit of the virtual rig, noise and all."""
    setup = parse_rig_file(read_template()).setup
    return VirtualRig(setup, VirtualRigSettings()).strike(HitLabel(setup.samples.samples[0].name))


@pytest.fixture
def write_rig():
    """Return a writer of rig files."""

    def write(hammer="", **changes):
        text = SOURCE.format(hammer=hammer)
        for old, new in changes.get("replace", {}).items():
            assert old in text
            text = text.replace(old, new)
        return read_template() + text

    return write


@pytest.fixture
def open_source(driver, write_rig):
    """Return what makes a source and its plan of a rig file."""
    sources = []

    def open_source(text=None, *, continuous=False, block_size=1000, depth=400):
        rig = parse_rig_file(text or write_rig())
        sources.append(NidaqmxSource(rig.source.without(*COMMON_KEYS[SOURCES])))
        plan = make_plan(rig.source, rig.setup)
        return sources[-1], replace(
            plan, continuous=continuous, block_size=block_size, depth=depth
        )

    yield open_source
    for source in sources:
        source.close()


RANGE = 5.0
STEP = RANGE / 2**15
"""Of the device's converter on its range of 5 V [V]."""
TIMEOUT = 10.0


def read_record(source, timeout=TIMEOUT):
    """Return a record's accelerations, one row per channel, and its blocks."""
    blocks = []
    while not (blocks and blocks[-1].last):
        block = source.read(timeout)
        assert block is not None, "no block came"
        blocks.append(block)
    return join(blocks), blocks


def join(blocks):
    channels = [[block.hammer for block in blocks], [block.specimen for block in blocks]]
    return np.array(
        [
            np.concatenate([block.output * block.scale + block.offset for block in row])
            for row in channels
        ]
    )


def strike(driver, source, hit):
    source.arm()
    driver.feed(hit)
    return read_record(source)


def to_acceleration(block):
    return block.output * block.scale + block.offset


def digitize(acceleration, sensitivity):
    """Return what a converter of 16 bits makes of an acceleration [m/s^2]."""
    counts = np.round(acceleration * sensitivity / STEP)
    return np.clip(counts, -32768, 32767) * STEP / sensitivity


def find_start(acceleration, level):
    return int(np.argmax(np.abs(acceleration) > level))


def flip(hit):
    """Return a hit whose hammer pulse has the other sign."""
    return replace(hit, hammer=replace(hit.hammer, scale=-hit.hammer.scale))


def test_a_record_is_what_was_fed_with_the_trigger_in_its_place(driver, open_source, hit):
    source, plan = open_source()
    source.configure(plan)
    record, blocks = strike(driver, source, hit)
    fed = np.array(
        [
            digitize(to_acceleration(block), sensitivity)
            for block, sensitivity in zip(
                (hit.hammer, hit.specimen), driver.device.sensitivities, strict=True
            )
        ]
    )
    shift = find_start(fed[0], plan.trigger_level) - plan.pre_trigger_points
    assert find_start(record[0], plan.trigger_level) == plan.pre_trigger_points == 500
    assert record.shape == (2, plan.points) == (2, 5000)
    begin, end = max(0, -shift), min(plan.points, fed.shape[1] - shift)
    assert end - begin > 4900
    np.testing.assert_allclose(
        record[:, begin:end], fed[:, begin + shift : end + shift], rtol=1e-12, atol=1e-9
    )
    assert [block.first_sample for block in blocks] == [0]
    assert blocks[0].hammer.full_scale == pytest.approx(RANGE / 0.010 * STANDARD_GRAVITY)


def test_the_rate_is_what_the_device_makes_of_it(open_source, write_rig):
    source, plan = open_source(write_rig(replace={"2.5 MHz": "2.4 MHz"}))
    assert source.configure(plan).sampling_rate == pytest.approx(100e6 / 42)


def test_a_rate_that_is_far_from_what_the_device_can_is_refused(open_source, write_rig):
    source, plan = open_source(write_rig(replace={"2.5 MHz": "3.9 MHz"}))
    with pytest.raises(ParameterError, match=r"line \d+: sampling_rate .* 3.84615e\+06 Hz"):
        source.configure(plan)


@pytest.mark.parametrize("sensitivity", ["10 mV/g", "-10 mV/g"])
@pytest.mark.parametrize("rises", [True, False])
def test_both_signs_trigger_whichever_way_the_sensor_looks(
    driver, open_source, write_rig, hit, sensitivity, rises
):
    if sensitivity.startswith("-"):
        hammer, specimen = driver.device.sensitivities
        driver.device.sensitivities = (-hammer, specimen)
    source, plan = open_source(write_rig(replace={'"10 mV/g"': f'"{sensitivity}"'}))
    source.configure(plan)
    acceleration = to_acceleration(hit.hammer)
    is_rising = acceleration[np.argmax(np.abs(acceleration))] > 0
    record, _ = strike(driver, source, hit if is_rising == rises else flip(hit))
    start = find_start(record[0], plan.trigger_level)
    assert start == plan.pre_trigger_points
    assert (record[0][start] > 0) == rises


@pytest.mark.parametrize("detects", [True, False], ids=["told by the device", "seen at the rail"])
def test_a_channel_beyond_its_range_is_overloaded_and_no_other(driver, open_source, hit, detects):
    driver.device.has_overload_detection = detects
    source, plan = open_source()
    source.configure(plan)
    peak = np.max(np.abs(to_acceleration(hit.specimen))) * abs(driver.device.sensitivities[1])
    loud = replace(hit, specimen=replace(hit.specimen, scale=hit.specimen.scale * 6.0 / peak))
    for _ in range(2):
        _, blocks = strike(driver, source, loud)
        assert any(block.specimen.overloaded for block in blocks)
        assert not any(block.hammer.overloaded for block in blocks)
    _, blocks = strike(driver, source, hit)
    assert not any(block.specimen.overloaded for block in blocks)


def test_a_force_on_the_hammer_is_an_acceleration_of_its_mass(driver, open_source, write_rig, hit):
    source, plan = open_source(
        write_rig(
            hammer='quantity = "force"',
            replace={'"10 mV/g"': '"2 mV/N"', '"5 g"': '"5 N"'},
        )
    )
    mass = plan.hammer.moving_mass
    driver.device.sensitivities = (0.002 * mass, driver.device.sensitivities[1])
    source.configure(plan)
    record, _ = strike(driver, source, hit)
    assert np.max(record[0]) == pytest.approx(np.max(to_acceleration(hit.hammer)), rel=1e-3)


def test_a_sensor_with_a_supply_of_its_own_is_a_voltage(driver, open_source, write_rig, hit):
    source, plan = open_source(write_rig(replace={'"4 mA"': '"off"'}))
    for refused in ("create_ai_accel_chan", "set_chan_attribute_int32"):
        driver.errors[refused] = -1  # neither a supply nor a coupling is asked for
    source.configure(plan)
    record, _ = strike(driver, source, hit)
    fed = digitize(to_acceleration(hit.specimen), driver.device.sensitivities[1])
    assert np.min(record[1]) == pytest.approx(np.min(fed))
    assert np.max(record[1]) == pytest.approx(np.max(fed))


def test_the_sample_need_not_be_measured(driver, open_source, write_rig, hit):
    driver.device.samples_at_once = False
    source, plan = open_source(write_rig().rpartition("[source.specimen]")[0])
    source.configure(plan)
    source.arm()
    driver.feed(hit)
    block = source.read(TIMEOUT)
    assert block.hammer.output.size == 5000
    assert block.specimen.output.size == 0


def test_the_range_is_by_default_what_the_sensor_takes(driver, open_source, write_rig, hit):
    source, plan = open_source(write_rig(replace={'range = "5 V"\n\n': 'full_scale = "90 g"\n'}))
    source.configure(plan)
    block = strike(driver, source, hit)[1][0]
    assert block.hammer.full_scale == pytest.approx(90 * STANDARD_GRAVITY)


def test_a_hit_in_a_stream_is_what_was_fed(driver, open_source, hit):
    source, plan = open_source(continuous=True, block_size=25_000)
    source.configure(plan)
    source.arm()
    driver.feed(hit)
    blocks = []
    while sum(block.hammer.output.size for block in blocks) < 250_000:
        blocks.append(source.read(TIMEOUT))
    stream = join(blocks)
    fed = digitize(to_acceleration(hit.hammer), driver.device.sensitivities[0])
    start = find_start(stream[0], plan.trigger_level) - find_start(fed, plan.trigger_level)
    np.testing.assert_allclose(stream[0, start : start + fed.size], fed, rtol=1e-12, atol=1e-9)


def test_who_reads_a_stream_too_late_loses_samples_and_goes_on(open_source, write_rig):
    text = write_rig(replace={"2.5 MHz": "1 MHz"})
    source, plan = open_source(text, continuous=True, block_size=10_000, depth=10)
    source.configure(plan)
    source.arm()
    first = source.read(TIMEOUT)
    time.sleep(0.15)  # the buffer holds 0.1 s
    blocks = [source.read(TIMEOUT) for _ in range(4)]
    assert first.first_sample == 0
    assert blocks[0].first_sample > first.hammer.output.size, "a gap is seen"
    ends = [block.first_sample + block.hammer.output.size for block in blocks]
    assert [block.first_sample for block in blocks[1:]] == ends[:-1], "and then none"


LINE = "Dev1/port0/line0"


@pytest.fixture
def open_holder(driver):
    """Return what makes a holder on the driver; all are closed in the end."""
    holders = []

    def open_holder(**options):
        table = {"line": LINE, **options}
        holders.append(NidaqmxHolder(TomlTable(table, "[holder]")))
        return holders[-1]

    yield open_holder
    for holder in holders:
        holder.close()


@pytest.mark.parametrize(("energized", "level"), [("holds", True), ("releases", False)])
def test_the_line_is_high_or_low_while_it_holds_as_the_rig_file_says(
    driver, open_holder, energized, level
):
    holder = open_holder(energized=energized)
    assert holder.configure() == f"NI virtual digitizer 01A2B3C4, simulated, {LINE}"
    assert driver.device.levels[LINE] is level
    holder.release()
    assert driver.device.levels[LINE] is not level
    holder.hold()
    assert driver.device.levels[LINE] is level


def test_a_line_that_contradicts_what_it_was_told_is_an_error(driver, open_holder):
    holder = open_holder()
    holder.configure()
    driver.device.set_level(LINE, level=False)
    with pytest.raises(DeviceError, match="is low, though it was told holding"):
        holder.read_state()


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("Dev2/port0/line0", "NI-DAQmx knows no device 'Dev2': known are Dev1"),
        ("Dev1/port7/line0", "Dev1 has no output line 'Dev1/port7/line0': it has Dev1/port0/li"),
        ("line0", "give device and terminal"),
    ],
)
def test_a_wrong_line_is_refused_with_its_line_of_the_rig_file(driver, line, message):
    text = f'[holder]\ndriver = "nidaqmx"\nline = "{line}"\n'
    table = parse_toml_table(text).take_table("holder")
    holder = NidaqmxHolder(table.without(*COMMON_KEYS[HOLDERS]))
    with pytest.raises((DeviceError, ParameterError), match=f"line 3: .*{message}") as found:
        holder.configure()
    check_sentence(found.value)


def test_a_line_that_another_program_holds_is_not_touched(driver, open_holder):
    with Task() as other:
        other.do_channels.add_do_chan(LINE)
        writer = DigitalSingleChannelWriter(other.out_stream, auto_start=True)
        writer.write_one_sample_one_line(False)
        with pytest.raises(DeviceError, match=r"held by another program.*-50103"):
            open_holder().configure()
        assert driver.device.levels[LINE] is False
    open_holder().configure()
    assert driver.device.levels[LINE] is True


def test_source_and_holder_share_a_device(driver, open_holder, open_source, hit):
    source, plan = open_source()
    holder = open_holder()
    source.configure(plan)
    holder.configure()
    source.arm()
    strike = threading.Timer(0.05, driver.feed, [hit])
    holder.release()
    strike.start()
    assert source.read(10.0).hammer.output.size == 5000
    strike.join()
    holder.hold()
    assert driver.device.falls == {LINE: 1}
    source.close()
    assert holder.read_state() is HolderState.HOLDING


def find_line(text, part):
    """Return where in a rig file a text stands last, counted from 1."""
    return max(number for number, line in enumerate(text.splitlines(), 1) if part in line)


@pytest.mark.parametrize(
    ("old", "new", "message", "line"),
    [
        ("Dev1/ai0", "Dev7/ai0", "NI-DAQmx knows no device 'Dev7': known are Dev1", "Dev7"),
        ("Dev1/ai0", "Dev1/ai9", "Dev1 has no analog input 'Dev1/ai9': it has Dev1/ai0", "ai9"),
        ("Dev1/ai0", "ai0", "give device and terminal, like Dev1/ai0", '"ai0"'),
        ("Dev1/ai0", "Dev1/ai0, Dev1/ai1", "give device and terminal", "ai0, Dev1"),
        ('range = "5 V"', 'range = "30 V"', "Property: AI.Max", "[source.h"),
        ('sensitivity = "10 mV/g"', "", "has no sensitivity", "[source.h"),
        ('range = "5 V"', "", r"lacks range: give it, for example range = \"5 V\"", "[source.h"),
        ('"4 mA"', '"7 mA"', "Property: AI.Excit.Val.*-200077", "[source.h"),
        ('iepe_current = "4 mA"', "", "lacks iepe_current", "[source.h"),
        ('"2.5 MHz"', '"20 MHz"', "Requested Value: 20000000.0 Maximum Value.*-200332", "20 MHz"),
        ('"5 g"', '"900 g"', "channel shows 4903.32 m/s.2 at most", "900 g"),
    ],
)  # fmt: skip
def test_a_wrong_value_is_refused_with_its_line(open_source, write_rig, old, new, message, line):
    text = write_rig()
    head, mark, tail = text.rpartition("\n[source]\n")
    assert old in tail
    text = head + mark + tail.replace(old, new, 1)
    with pytest.raises(RigError, match=message) as found:
        configure(open_source, text)
    check_sentence(found.value)
    assert str(found.value).startswith(f"line {find_line(text, line)}: ")


def test_inputs_that_are_sampled_one_behind_the_other_are_refused(driver, open_source):
    driver.device.samples_at_once = False
    source, plan = open_source()
    with pytest.raises(ParameterError, match=r"line \d+: Dev1 samples its inputs one behind"):
        source.configure(plan)


@pytest.mark.parametrize(
    ("call", "code"),
    [
        ("create_task", -201003),
        ("start_task", -50405),
        ("read_analog_f64", -88709),
        ("stop_task", -999),
    ],
)
def test_an_error_at_any_call_is_one_sentence_with_its_code(driver, open_source, hit, call, code):
    driver.errors[call] = code
    source, plan = open_source()
    with pytest.raises(DeviceError, match=rf"Dev1.*{code}") as found:
        read_one(driver, source, plan, hit)
    check_sentence(found.value)
    driver.errors.clear()
    read_one(driver, source, plan, hit)


def test_ni_daqmx_does_not_warn_where_a_task_is_disarmed(driver, open_source):
    source, plan = open_source()
    source.configure(plan)
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        source.arm()
        warnings.warn(DaqWarning("It has been stopped.", 200010), stacklevel=1)
        warnings.warn(DaqWarning("Something else.", 200011), stacklevel=1)
    assert ["200011" in str(warning.message) for warning in seen] == [True]


def test_without_ni_daqmx_it_says_what_to_install():
    with pytest.raises(DeviceError, match=r"install it from ni\.com"), report_errors("NI-DAQmx"):
        raise DaqNotFoundError("nothing was found")


@given(st.text(), st.integers(-2_000_000, -1))
@settings(max_examples=30)
def test_whatever_ni_daqmx_says_becomes_one_sentence(text, code):
    for error in (DaqError(text, code), DaqReadError(text, code, 3)):
        with pytest.raises(RigError) as found, report_errors("NI device Dev1"):
            raise error
        check_sentence(found.value)
        assert str(code) in str(found.value)


def configure(open_source, text):
    source, plan = open_source(text)
    source.configure(plan)


def read_one(driver, source, plan, hit, timeout=TIMEOUT):
    """Go through a source's whole life."""
    source.configure(plan)
    source.arm()
    driver.feed(hit)
    assert source.read(timeout) is not None
    source.arm()
    source.disarm()
    source.close()


SPARE_LINE = "Dev1/port0/line3"
RECORD_BLOCK, STREAM_BLOCK = 1000, 25_000
"""Points, as the node asks for them: a busy machine has no time for 2500 reads a second."""


class NiSourceBench(SourceBench):
    def __init__(self, driver, open_source, hit):
        self.driver = driver
        self.open_source = open_source
        self.hit = hit

    def get_driver(self):
        return NidaqmxSource

    def make_source(self):
        return self.open_source()[0]

    def make_plan(self, *, continuous=False):
        block_size = STREAM_BLOCK if continuous else RECORD_BLOCK
        return self.open_source(continuous=continuous, block_size=block_size)[1]

    def strike(self, source):
        self.driver.feed(self.hit)

    def unplug(self):
        self.driver.device.set_present(present=False)

    def plug(self):
        self.driver.device.set_present(present=True)


class NiHolderBench(HolderBench):
    def __init__(self, driver):
        self.driver = driver

    def get_driver(self):
        return NidaqmxHolder

    def make_holder(self):
        options = {"line": SPARE_LINE}
        return NidaqmxHolder(TomlTable(options, "[holder]"))

    def unplug(self):
        self.driver.device.set_present(present=False)

    def plug(self):
        self.driver.device.set_present(present=True)

    def is_holding(self):
        return self.driver.device.levels[SPARE_LINE]

    def count_releases(self):
        return self.driver.device.falls.get(SPARE_LINE, 0)


class TestNidaqmxSource(AccelerationSourceContract):
    @pytest.fixture
    def bench(self, driver, open_source, hit):
        return NiSourceBench(driver, open_source, hit)


class TestNidaqmxHolder(HammerHolderContract):
    @pytest.fixture
    def bench(self, driver):
        return NiHolderBench(driver)
