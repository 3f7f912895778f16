"""The driver `nidaqmx`: what is read is what was fed, and the line holds until it is told."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from nidaqmx.stream_writers import DigitalSingleChannelWriter

from impact_rig.configuration.toml_table import TomlTable, parse_toml_table
from impact_rig.core.errors import DeviceError, ParameterError
from impact_rig.core.setup.calibration import STANDARD_GRAVITY
from impact_rig.devices.drivers import COMMON_KEYS, HOLDERS
from impact_rig.devices.nidaqmx import drivers as holder_module
from impact_rig.devices.nidaqmx.drivers import NidaqmxHolder, NidaqmxSource
from impact_rig.devices.nidaqmx.session import Session
from impact_rig.devices.protocols import HolderState
from impact_rig.testing.contract import (
    AccelerationSourceContract,
    HammerHolderContract,
    HolderBench,
    SourceBench,
    check_sentence,
)

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


def strike(server, source, hit):
    source.arm()
    server.feed(hit)
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


def test_a_record_is_what_was_fed_with_the_trigger_in_its_place(server, open_source, hit):
    source, plan = open_source()
    source.configure(plan)
    record, blocks = strike(server, source, hit)
    fed = np.array(
        [
            digitize(to_acceleration(block), sensitivity)
            for block, sensitivity in zip(
                (hit.hammer, hit.specimen), server.device.sensitivities, strict=True
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


@pytest.mark.parametrize(
    ("sensitivity", "edge", "rises", "triggers"),
    [
        ("10 mV/g", "either", False, True),
        ("10 mV/g", "rising", True, True),
        ("-10 mV/g", "rising", False, False),
        ("-10 mV/g", "falling", False, True),
    ],
)
def test_the_edge_is_that_of_the_acceleration_whichever_way_the_sensor_looks(
    server, open_source, write_rig, hit, sensitivity, edge, rises, triggers
):
    if sensitivity.startswith("-"):
        hammer, specimen = server.device.sensitivities
        server.device.sensitivities = (-hammer, specimen)
    source, plan = open_source(
        write_rig(more=f'edge = "{edge}"', replace={'"10 mV/g"': f'"{sensitivity}"'})
    )
    source.configure(plan)
    # Noise and offset of the hit: below the level, but a pulse crosses it once each way.
    acceleration = to_acceleration(hit.hammer)
    is_rising = acceleration[np.argmax(np.abs(acceleration))] > 0
    hit = hit if is_rising == rises else flip(hit)
    source.arm()
    server.feed(hit)
    if not triggers:
        # Its pulse's other flank crosses the other level never, the ringing stays below.
        assert source.read(0.05) is None
        return
    record, _ = read_record(source)
    start = find_start(record[0], plan.trigger_level)
    assert start == plan.pre_trigger_points
    assert (record[0][start] > 0) == rises


def test_a_terminal_may_be_the_trigger(server, open_source, write_rig, hit):
    source, plan = open_source(write_rig(more='trigger = "/Dev1/PFI0"'))
    source.configure(plan)
    assert "CfgDigEdgeRefTrig" in server.calls
    source.arm()
    server.feed(hit)
    assert source.read(0.05) is None, "nothing is connected to the terminal"


@pytest.mark.parametrize("detects", [True, False], ids=["told by the device", "seen at the rail"])
def test_a_channel_beyond_its_range_is_overloaded_and_no_other(server, open_source, hit, detects):
    server.device.has_overload_detection = detects
    source, plan = open_source()
    source.configure(plan)
    peak = np.max(np.abs(to_acceleration(hit.specimen))) * abs(server.device.sensitivities[1])
    loud = replace(hit, specimen=replace(hit.specimen, scale=hit.specimen.scale * 6.0 / peak))
    for _ in range(2):
        _, blocks = strike(server, source, loud)
        assert any(block.specimen.overloaded for block in blocks)
        assert not any(block.hammer.overloaded for block in blocks)
    _, blocks = strike(server, source, hit)
    assert not any(block.specimen.overloaded for block in blocks)


def test_a_force_on_the_hammer_is_an_acceleration_of_its_mass(server, open_source, write_rig, hit):
    source, plan = open_source(
        write_rig(
            hammer='quantity = "force"',
            replace={'"10 mV/g"': '"2 mV/N"', '"5 g"': '"5 N"'},
        )
    )
    mass = plan.hammer.moving_mass
    server.device.sensitivities = (0.002 * mass, server.device.sensitivities[1])
    source.configure(plan)
    assert "CreateAIForceIEPEChan" in server.calls
    record, blocks = strike(server, source, hit)
    assert np.max(record[0]) == pytest.approx(np.max(to_acceleration(hit.hammer)), rel=1e-3)
    assert blocks[0].hammer.scale == pytest.approx(1.0 / mass)


def test_a_sensor_with_a_supply_of_its_own_is_a_voltage(server, open_source, write_rig, hit):
    source, plan = open_source(write_rig(replace={'"4 mA"': '"off"'}))
    source.configure(plan)
    assert "CreateAIVoltageChan" in server.calls
    assert "CreateAIAccelChan" not in server.calls
    assert "SetChanAttributeInt32" not in server.calls, "the coupling is the device's own"
    record, _ = strike(server, source, hit)
    fed = digitize(to_acceleration(hit.specimen), server.device.sensitivities[1])
    assert np.min(record[1]) == pytest.approx(np.min(fed))
    assert np.max(record[1]) == pytest.approx(np.max(fed))


def test_the_sample_need_not_be_measured(server, open_source, write_rig, hit):
    server.device.samples_at_once = False
    source, plan = open_source(write_rig().rpartition("[source.specimen]")[0])
    source.configure(plan)
    source.arm()
    server.feed(hit)
    block = source.read(TIMEOUT)
    assert block.hammer.output.size == 5000
    assert block.specimen.output.size == 0


def test_the_range_is_by_default_what_the_sensor_takes(open_source, write_rig):
    source, plan = open_source(write_rig(replace={'range = "5 V"\n\n': 'full_scale = "90 g"\n'}))
    source.configure(plan)
    assert source._reading._inputs[0].limit == pytest.approx(1.0 / 0.010 * STANDARD_GRAVITY)
    assert source._reading._inputs[0].full_scale == pytest.approx(90 * STANDARD_GRAVITY)


def test_a_hit_in_a_stream_is_what_was_fed(server, open_source, hit):
    source, plan = open_source(continuous=True, block_size=25_000)
    source.configure(plan)
    source.arm()
    server.feed(hit)
    blocks = []
    while sum(block.hammer.output.size for block in blocks) < 250_000:
        blocks.append(source.read(TIMEOUT))
    stream = join(blocks)
    fed = digitize(to_acceleration(hit.hammer), server.device.sensitivities[0])
    start = find_start(stream[0], plan.trigger_level) - find_start(fed, plan.trigger_level)
    np.testing.assert_allclose(stream[0, start : start + fed.size], fed, rtol=1e-12, atol=1e-9)


def test_who_reads_a_stream_too_late_loses_samples_and_goes_on(open_source, write_rig):
    text = write_rig(replace={"2.5 MHz": "1 MHz"})
    source, plan = open_source(text, continuous=True, block_size=10_000, depth=2)
    source.configure(plan)
    source.arm()
    first = source.read(TIMEOUT)
    # NI-DAQmx's least buffer holds 100 000 samples at this rate: 0.1 s.
    time.sleep(0.15)
    blocks = [source.read(TIMEOUT) for _ in range(4)]
    assert first.first_sample == 0
    assert blocks[0].first_sample > first.hammer.output.size, "a gap is seen"
    ends = [block.first_sample + block.hammer.output.size for block in blocks]
    assert [block.first_sample for block in blocks[1:]] == ends[:-1], "and then none"


LINE = "Dev1/port0/line0"


@pytest.fixture
def open_holder(server):
    """Return what makes a holder on the server; all are closed in the end."""
    holders = []

    def open_holder(**options):
        table = {"line": LINE, "server": server.address, **options}
        holders.append(NidaqmxHolder(TomlTable(table, "[holder]")))
        return holders[-1]

    yield open_holder
    for holder in holders:
        holder.close()


@pytest.mark.parametrize(("energized", "level"), [("holds", True), ("releases", False)])
def test_the_line_is_high_or_low_while_it_holds_as_the_rig_file_says(
    server, open_holder, energized, level
):
    holder = open_holder(energized=energized)
    assert holder.configure() == f"NI virtual digitizer 01A2B3C4, simulated, {LINE}"
    assert server.device.levels[LINE] is level
    holder.release()
    assert server.device.levels[LINE] is not level
    holder.hold()
    assert server.device.levels[LINE] is level


def test_a_line_that_contradicts_what_it_was_told_is_an_error(server, open_holder):
    holder = open_holder()
    holder.configure()
    server.device.set_level(LINE, level=False)
    with pytest.raises(DeviceError, match="is low, which is released: it was told holding"):
        holder.read_state()


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("Dev2/port0/line0", "NI-DAQmx knows no device 'Dev2': known are Dev1"),
        ("Dev1/port7/line0", "Dev1 has no output line 'Dev1/port7/line0': it has Dev1/port0/li"),
        ("line0", "give device and terminal"),
    ],
)
def test_a_wrong_line_is_refused_with_its_line_of_the_rig_file(server, line, message):
    text = f'[holder]\ndriver = "nidaqmx"\nserver = "{server.address}"\nline = "{line}"\n'
    table = parse_toml_table(text).take_table("holder")
    holder = NidaqmxHolder(table.without(*COMMON_KEYS[HOLDERS]))
    with pytest.raises((DeviceError, ParameterError), match=f"line 4: .*{message}") as found:
        holder.configure()
    check_sentence(found.value)


def test_a_line_that_another_program_holds_is_not_touched(server, open_holder):
    other = Session("another program", server.address, 5.0)
    task = other.open_task("something else")
    task.do_channels.add_do_chan(LINE)
    DigitalSingleChannelWriter(task.out_stream, auto_start=True).write_one_sample_one_line(0)
    holder = open_holder()
    with pytest.raises(DeviceError, match=r"held by another program.*-50103"):
        holder.configure()
    assert server.device.levels[LINE] is False
    other.close()
    holder.configure()
    assert server.device.levels[LINE] is True


def test_another_device_of_the_same_name_is_refused(server, open_holder):
    with pytest.raises(DeviceError, match="01A2B3C4, not 0000BEEF: it is another device"):
        open_holder(serial_number="BEEF").configure()
    assert LINE not in server.device.levels


def test_a_release_that_the_server_never_answers_is_no_release(monkeypatch, server, open_holder):
    monkeypatch.setattr(holder_module, "HOLDER_PATIENCE", 0.1)
    holder = open_holder()
    holder.configure()
    server.silent.add("WriteDigitalLines")
    with pytest.raises(DeviceError, match="does not answer in time"):
        holder.release()
    server.silent.clear()
    assert holder.read_state() is HolderState.HOLDING


def test_source_and_holder_share_a_device(server, open_holder, open_source, hit):
    source, plan = open_source()
    holder = open_holder()
    source.configure(plan)
    holder.configure()
    source.arm()
    strike = threading.Timer(0.05, server.feed, [hit])
    holder.release()
    strike.start()
    assert source.read(10.0).hammer.output.size == 5000
    strike.join()
    holder.hold()
    assert server.device.falls == {LINE: 1}
    source.close()
    assert holder.read_state() is HolderState.HOLDING


SPARE_LINE = "Dev1/port0/line3"
RECORD_BLOCK, STREAM_BLOCK = 1000, 25_000
"""Points, as the node asks for them: a busy machine has no time for 2500 reads a second."""


class NiSourceBench(SourceBench):
    def __init__(self, server, open_source, hit):
        self.server = server
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
        self.server.feed(self.hit)

    def unplug(self):
        self.server.unplug()

    def plug(self):
        self.server.plug()


class NiHolderBench(HolderBench):
    def __init__(self, server):
        self.server = server

    def get_driver(self):
        return NidaqmxHolder

    def make_holder(self):
        options = {"line": SPARE_LINE, "server": self.server.address}
        return NidaqmxHolder(TomlTable(options, "[holder]"))

    def unplug(self):
        self.server.unplug()

    def plug(self):
        self.server.plug()

    def is_holding(self):
        return self.server.device.levels[SPARE_LINE]

    def count_releases(self):
        return self.server.device.falls.get(SPARE_LINE, 0)


class TestNidaqmxSource(AccelerationSourceContract):
    @pytest.fixture
    def bench(self, server, open_source, hit):
        return NiSourceBench(server, open_source, hit)


class TestNidaqmxHolder(HammerHolderContract):
    @pytest.fixture
    def bench(self, server):
        return NiHolderBench(server)
