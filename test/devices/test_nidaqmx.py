"""The drivers `nidaqmx` below NI's own library, with a device that is not there."""

import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("nidaqmx", reason="the drivers need the Python package nidaqmx")

from fakes.ni_driver import INPUTS, LINE, FakeDriver, Interpreter
from nidaqmx import Task, utils
from nidaqmx.constants import AcquisitionType
from nidaqmx.errors import DaqNotFoundError
from nidaqmx.stream_readers import AnalogMultiChannelReader
from nidaqmx.stream_writers import DigitalSingleChannelWriter

from impact_rig.configuration.rig_file import parse_rig_file, read_template
from impact_rig.configuration.toml_table import TomlTable, parse_toml_table
from impact_rig.core.given.errors import DeviceError, ParameterError, RigError
from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.sensors import STANDARD_GRAVITY
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.devices.drivers import COMMON_KEYS, SOURCES
from impact_rig.devices.nidaqmx import NidaqmxHolder, NidaqmxSource, report_errors
from impact_rig.devices.source_table import make_plan
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.testing import (
    AccelerationSourceContract,
    HammerHolderContract,
    HolderBench,
    SourceBench,
)
from impact_rig.testing.drivers import check_sentence

SENSITIVITIES = (0.010 / STANDARD_GRAVITY, -0.005 / STANDARD_GRAVITY)
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
[source.specimen]
channel = "Dev1/ai1"
sensitivity = "-5 mV/g"
iepe_current = "4 mA"
range = "5 V"
"""
RIG_FILE = read_template() + SOURCE
RANGE = 5.0
STEP = RANGE / 2**15  # [V], of the device's converter
TIMEOUT = 10.0


@pytest.fixture
def driver(monkeypatch):
    """Return NI's driver as `nidaqmx` finds it."""
    driver = FakeDriver(*SENSITIVITIES)
    monkeypatch.setattr(utils, "_select_interpreter", lambda *_: Interpreter(driver))
    return driver


@pytest.fixture(scope="session")
def hit():
    """Return a hit of the virtual rig, noise and all."""
    return VirtualRig(PAPER_SETUP, VirtualRigSettings()).strike(HitLabel("steel small"))


@pytest.fixture
def open_source(driver):
    """Return what makes a source and its plan of a rig file."""
    sources = []

    def open_source(text=RIG_FILE, **changes):
        rig = parse_rig_file(text)
        sources.append(NidaqmxSource(rig.source.without(*COMMON_KEYS[SOURCES])))
        return sources[-1], replace(make_plan(rig.source, rig.setup), **changes)

    yield open_source
    for source in sources:
        source.close()


def change(old, new):
    """Return the rig file with another text in its source, at the first place."""
    head, mark, tail = RIG_FILE.rpartition("\n[source]\n")
    assert old in tail
    return head + mark + tail.replace(old, new, 1)


def strike(driver, source, hit):
    source.arm()
    driver.feed(hit)
    block = source.read(TIMEOUT)
    assert block.last
    return block


def test_the_stand_in_does_what_nis_own_tests_ask_of_a_device(driver):
    """What NI's `test_analog_multi_channel_reader` has of the calls that the driver makes."""
    with Task() as task:
        for channel in INPUTS:
            task.ai_channels.add_ai_voltage_chan(channel, min_val=-5.0, max_val=5.0)
        mode = AcquisitionType.CONTINUOUS
        task.timing.cfg_samp_clk_timing(1e5, sample_mode=mode, samps_per_chan=100_000)
        task.start()
        volts = [SimpleNamespace(acceleration=np.full(90_000, value)) for value in (1.0, 2.0)]
        driver.sensitivities = (1.0, 1.0)
        driver.feed(SimpleNamespace(hammer=volts[0], specimen=volts[1]))
        reader = AnalogMultiChannelReader(task.in_stream)
        count = task.number_of_channels
        data = np.full((count, 50_000), np.inf)
        assert reader.read_many_sample(data, 50_000) == 50_000
        assert data[:, -10:] == pytest.approx(np.repeat([[1.0], [2.0]], 10, axis=1), abs=STEP)
        one = np.full(count, np.inf)
        reader.read_one_sample(one)
        assert one == pytest.approx([1.0, 2.0], abs=STEP)


def digitize(channel, sensitivity):
    """Return what a converter of 16 bits makes of a channel of a hit [m/s^2]."""
    counts = np.round(channel.acceleration * sensitivity / STEP)
    return np.clip(counts, -32768, 32767) * STEP / sensitivity


def find_start(acceleration, level):
    return int(np.argmax(np.abs(acceleration) > level))


def test_a_record_is_what_was_fed_with_the_trigger_in_its_place(driver, open_source, hit):
    source, plan = open_source()
    source.configure(plan)
    block = strike(driver, source, hit)
    assert find_start(block.hammer.acceleration, plan.trigger_level) == 500
    for name, sensitivity in zip(("hammer", "specimen"), SENSITIVITIES, strict=True):
        fed = digitize(getattr(hit, name), sensitivity)
        if name == "hammer":
            shift = find_start(fed, plan.trigger_level) - plan.pre_trigger_points
        begin, end = max(0, -shift), min(plan.points, fed.size - shift)
        assert end - begin > 4900
        found = getattr(block, name).acceleration
        assert found.size == plan.points == 5000
        np.testing.assert_allclose(
            found[begin:end], fed[begin + shift : end + shift], rtol=1e-12, atol=1e-9
        )
    assert block.hammer.full_scale == pytest.approx(RANGE / 0.010 * STANDARD_GRAVITY)


def test_the_rate_is_what_the_device_makes_of_it(open_source):
    source, plan = open_source(change("2.5 MHz", "2.4 MHz"))
    assert source.configure(plan).sampling_rate == pytest.approx(100e6 / 42)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("rises", [True, False])
def test_both_signs_trigger_whichever_way_the_sensor_looks(driver, open_source, hit, sign, rises):
    driver.sensitivities = (sign * SENSITIVITIES[0], SENSITIVITIES[1])
    source, plan = open_source(change('"10 mV/g"', f'"{sign * 10} mV/g"'))
    source.configure(plan)
    acceleration = hit.hammer.acceleration
    if (acceleration[np.argmax(np.abs(acceleration))] > 0) != rises:
        hit = replace(hit, hammer=replace(hit.hammer, scale=-hit.hammer.scale))
    found = strike(driver, source, hit).hammer.acceleration
    start = find_start(found, plan.trigger_level)
    assert start == plan.pre_trigger_points
    assert (found[start] > 0) == rises


@pytest.mark.parametrize("detects", [True, False], ids=["told by the device", "seen at the rail"])
def test_a_channel_beyond_its_range_is_overloaded_and_no_other(driver, open_source, hit, detects):
    driver.has_overload_detection = detects
    source, plan = open_source()
    source.configure(plan)
    peak = np.max(np.abs(hit.specimen.acceleration)) * abs(SENSITIVITIES[1])
    loud = replace(hit, specimen=replace(hit.specimen, scale=hit.specimen.scale * 6.0 / peak))
    block = strike(driver, source, loud)
    assert (block.hammer.overloaded, block.specimen.overloaded) == (False, True)
    block = strike(driver, source, hit)
    assert (block.hammer.overloaded, block.specimen.overloaded) == (False, False)


def test_a_sensor_with_a_supply_of_its_own_is_a_voltage(driver, open_source, hit):
    source, plan = open_source(RIG_FILE.replace('"4 mA"', '"off"'))
    for refused in ("create_ai_accel_chan", "set_chan_attribute_int32"):
        driver.errors[refused] = -1  # neither a supply nor a coupling is asked for
    source.configure(plan)
    found = strike(driver, source, hit).specimen.acceleration
    assert np.max(found) == pytest.approx(np.max(digitize(hit.specimen, SENSITIVITIES[1])))


def test_the_sample_need_not_be_measured(driver, open_source, hit):
    driver.samples_at_once = False
    source, plan = open_source(RIG_FILE.rpartition("[source.specimen]")[0])
    source.configure(plan)
    block = strike(driver, source, hit)
    assert (block.hammer.output.size, block.specimen.output.size) == (5000, 0)


def test_inputs_that_are_sampled_one_behind_the_other_are_refused(driver, open_source):
    driver.samples_at_once = False
    source, plan = open_source()
    with pytest.raises(ParameterError, match=r"line \d+: Dev1 samples its inputs one after"):
        source.configure(plan)


def test_a_stream_that_is_read_too_late_loses_samples_and_goes_on(open_source):
    text = change("2.5 MHz", "1 MHz")
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


@pytest.mark.parametrize(
    ("old", "new", "message", "line"),
    [
        ("Dev1/ai0", "Dev7/ai0", "NI-DAQmx knows no device 'Dev7': known are Dev1", "Dev7"),
        ("Dev1/ai0", "Dev1/ai9", "does not exist on this device. Name: Dev1/ai9", "[source.h"),
        ("Dev1/ai0", "ai0", "give device and terminal, like Dev1/ai0", '"ai0"'),
        ('sensitivity = "10 mV/g"', "", "has no sensitivity", "[source.h"),
        ('range = "5 V"', "", r"lacks range: give it, for example range = \"5 V\"", "[source.h"),
        ('iepe_current = "4 mA"', "", "lacks iepe_current", "[source.h"),
        ('"2.5 MHz"', '"20 MHz"', "SampClk.Rate Requested Value: 20000000.0", "20 MHz"),
        ('"2.5 MHz"', '"3.9 MHz"', r"the nearest rate of the device is 3.84615e\+06", "3.9 MHz"),
        ('"5 g"', '"900 g"', "channel shows 4903.32 m/s.2 at most", "900 g"),
    ],
)  # fmt: skip
def test_a_wrong_value_is_refused_with_its_line(open_source, old, new, message, line):
    def configure():
        source, plan = open_source(text)
        source.configure(plan)

    text = change(old, new)
    with pytest.raises(RigError, match=message) as found:
        configure()
    check_sentence(found.value)
    number = max(number for number, words in enumerate(text.splitlines(), 1) if line in words)
    assert str(found.value).startswith(f"line {number}: ")


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
    def live():
        source.configure(plan)
        strike(driver, source, hit)
        source.arm()
        source.disarm()
        source.close()

    driver.errors[call] = code
    source, plan = open_source()
    with pytest.raises(DeviceError, match=rf"Dev1.*{code}") as found:
        live()
    check_sentence(found.value)
    driver.errors.clear()
    source.close()
    live()


def test_without_ni_daqmx_it_says_what_to_install():
    with pytest.raises(DeviceError, match=r"install it from ni\.com"), report_errors("NI-DAQmx"):
        raise DaqNotFoundError("nothing was found")


def make_holder(line=LINE, **options):
    return NidaqmxHolder(TomlTable({"line": line, **options}, "[holder]"))


@pytest.mark.parametrize(("energized", "level"), [("holds", True), ("releases", False)])
def test_the_line_is_high_or_low_while_it_holds_as_the_rig_file_says(driver, energized, level):
    holder = make_holder(energized=energized)
    assert holder.configure() == f"NI virtual digitizer 01A2B3C4, simulated, {LINE}"
    assert driver.levels[LINE] is level
    holder.release()
    assert driver.levels[LINE] is not level
    holder.hold()
    assert driver.levels[LINE] is level


def test_a_line_that_contradicts_what_it_was_told_is_an_error(driver):
    holder = make_holder()
    holder.configure()
    driver.levels[LINE] = False
    with pytest.raises(DeviceError, match="is low, but the last command was holding"):
        holder.read_state()


def test_a_wrong_line_is_refused_with_its_line_of_the_rig_file(driver):
    table = parse_toml_table('[holder]\nline = "Dev1/port7/line0"\n').take_table("holder")
    message = "line 2: .*does not exist on this device. Name: Dev1/port7/line0"
    with pytest.raises(ParameterError, match=message) as found:
        NidaqmxHolder(table).configure()
    check_sentence(found.value)


def test_a_line_that_another_program_holds_is_not_touched(driver):
    with Task() as other:
        other.do_channels.add_do_chan(LINE)
        writer = DigitalSingleChannelWriter(other.out_stream, auto_start=True)
        writer.write_one_sample_one_line(False)
        with pytest.raises(DeviceError, match=r"resource is reserved.*-50103"):
            make_holder().configure()
        assert driver.levels[LINE] is False
    make_holder().configure()
    assert driver.levels[LINE] is True


class NiSourceBench(SourceBench):
    driver = NidaqmxSource

    def __init__(self, driver, open_source, hit):
        self.open_source = open_source
        self.strike = lambda source: driver.feed(hit)
        self.unplug, self.plug = driver.unplug, driver.plug

    def make_source(self):
        return self.open_source()[0]

    def make_plan(self, *, continuous=False):
        # Blocks as the node asks for them: a busy machine has no time for 2500 reads a second.
        return self.open_source(continuous=continuous, block_size=25_000)[1]


class NiHolderBench(HolderBench):
    driver = NidaqmxHolder

    def __init__(self, driver):
        self.is_holding = lambda: driver.levels[LINE]
        self.count_releases = lambda: driver.falls[LINE]
        self.unplug, self.plug = driver.unplug, driver.plug

    def make_holder(self):
        return make_holder()


class TestNidaqmxSource(AccelerationSourceContract):
    @pytest.fixture
    def bench(self, driver, open_source, hit):
        return NiSourceBench(driver, open_source, hit)


class TestNidaqmxHolder(HammerHolderContract):
    @pytest.fixture
    def bench(self, driver):
        return NiHolderBench(driver)
