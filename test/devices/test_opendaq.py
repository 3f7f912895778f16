"""The driver of openDAQ devices, on the reference device that openDAQ brings."""

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.configuration.toml_table import TomlTable, parse_toml_table
from impact_rig.core.given.errors import DeviceError, ParameterError
from impact_rig.core.given.sensors import STANDARD_GRAVITY, Sensor
from impact_rig.devices.opendaq import OpenDaqSource, SignalFormat, make_instance, make_scale
from impact_rig.devices.protocols import AcquisitionPlan, SourceChannel
from impact_rig.testing import AccelerationSourceContract, SourceBench

opendaq = pytest.importorskip("opendaq", reason="pip install opendaq")

RATE = 1e6
ADDRESS = "daqref://device0"
SENSITIVITY = 0.01  # [V/g]: the device's 10 V are 1000 g
PATIENCE = 20.0  # [s]
SILENT = {"Amplitude": 0.0}


def make_channel(name: str, channel: str, **options) -> SourceChannel:
    sensor = Sensor(name, unit="g", sensitivity=SENSITIVITY)
    return SourceChannel(channel, sensor, options=TomlTable(options, f"[source.{name}]"))


PLAN = AcquisitionPlan(
    sampling_rate=RATE,
    record_duration=2e-3,
    pre_trigger=0.2e-3,
    trigger_level=200.0 * STANDARD_GRAVITY,
    hammer=make_channel("hammer", "RefCh0", properties={"Frequency": 10_000.0, **SILENT}),
    specimen=make_channel("specimen", "RefCh1", properties=SILENT),
)


def make_table(**options) -> TomlTable:
    return TomlTable({"device": ADDRESS, **options}, "[source]")


@pytest.fixture
def make_source() -> Iterator:
    """Return a function that makes a configured source of the reference device."""
    sources = []

    def make(plan=PLAN, **options) -> OpenDaqSource:
        sources.append(OpenDaqSource(make_table(**options)))
        sources[-1].configure(plan)
        return sources[-1]

    yield make
    for source in sources:
        source.close()


def read_stream(source: OpenDaqSource, points: int) -> list:
    """Return so many points of the running stream, or some more."""
    blocks: list = []
    while sum(block.hammer.output.size for block in blocks) < points:
        blocks.append(source.read(PATIENCE))
        assert blocks[-1] is not None
    return blocks


def test_the_rate_that_the_device_gives_in_place_of_the_one_wanted_is_told(make_source):
    table = f'[source]\ndevice = "{ADDRESS}"\nsampling_rate = "2.5 MHz"\n'
    options = parse_toml_table(table).take_table("source")
    source = OpenDaqSource(options.without("sampling_rate"))
    with pytest.raises(ParameterError, match=r"is 2500000 Hz: .* samples at 1000000 Hz; write"):
        source.configure(replace(PLAN, sampling_rate=2.5e6))
    source.close()


def test_it_says_what_it_is_and_that_it_computes_its_numbers():
    source = OpenDaqSource(make_table())
    found = source.configure(PLAN)
    source.close()
    assert found.identity == "openDAQ device openDAQ Reference device DevSer0 at daqref://device0"
    assert found.is_simulated
    assert found.sampling_rate == RATE


@pytest.mark.parametrize("name", ["RefCh1", "2", "/openDAQDevice/Dev/RefDev0/IO/AI/RefCh1"])
def test_a_channel_has_a_name_a_number_and_a_path(make_source, name):
    hammer = make_channel("hammer", name, properties={"Waveform": 4, "ConstantValue": 3.0})
    source = make_source(replace(PLAN, hammer=hammer, specimen=None, continuous=True))
    source.arm()
    block = read_stream(source, 1)[-1]
    assert block.hammer.acceleration == pytest.approx(3.0 / SENSITIVITY * STANDARD_GRAVITY)
    assert block.specimen.output.size == 0


def test_the_range_is_the_one_of_the_channel(make_source):
    source = make_source(replace(PLAN, continuous=True))
    assert [scale.full_scale for scale in source.scales] == pytest.approx(
        [10.0 / SENSITIVITY * STANDARD_GRAVITY] * 2
    )
    source.device.channels_recursive[0].set_property_value("Amplitude", 10.0)
    source.arm()
    assert any(block.hammer.overloaded for block in read_stream(source, 200_000))


@pytest.mark.parametrize(
    ("unit", "sensor", "scale", "full_scale"),
    [
        ("g", Sensor("hammer", full_scale=300.0), STANDARD_GRAVITY, 300.0),
        ("m/s²", Sensor("hammer"), 1.0, 500.0),
        ("mV", Sensor("hammer", unit="g", sensitivity=0.01), 0.1 * STANDARD_GRAVITY, 490.3325),
    ],
)
def test_what_the_numbers_mean_stands_in_the_channels_unit(unit, sensor, scale, full_scale):
    found = make_scale(
        SourceChannel("AI 1", sensor), SignalFormat(RATE, 1, np.dtype(np.float64), unit, 500.0)
    )
    assert found.scale == pytest.approx(scale)
    assert found.full_scale == pytest.approx(full_scale)


@pytest.mark.parametrize(
    ("unit", "limit", "sensor", "words"),
    [
        ("V", 10.0, Sensor("hammer"), r"has no sensitivity"),
        ("g", 10.0, Sensor("hammer", sensitivity=0.1), r"delivers g and not V, leave sens"),
        ("g", 0.0, Sensor("hammer"), r"does not tell its range: add full_scale"),
        ("°C", 10.0, Sensor("hammer"), r"unit '°C' is unknown"),
    ],
)
def test_a_scale_that_cannot_be_known_is_refused(unit, limit, sensor, words):
    channel = SourceChannel("AI 1", sensor, options=TomlTable({}, "[source.hammer]"))
    with pytest.raises(ParameterError, match=words):
        make_scale(channel, SignalFormat(RATE, 1, np.dtype(np.float64), unit, limit))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"hammer": make_channel("hammer", "AI 7")}, r"is 'AI 7': .* has RefCh0, RefCh1, or"),
        ({"hammer": make_channel("hammer", "3")}, r"is '3'"),
        ({"hammer": make_channel("hammer", "2")}, r"is 'RefCh1', which is that of .source.ham"),
        ({"hammer": make_channel("hammer", "1", colour="red")}, r"unknown key 'colour'"),
        (
            {"hammer": make_channel("hammer", "1", properties={"Gain": 2})},
            r"RefCh0 has no property 'Gain': it has Waveform, ",
        ),
        (
            {"hammer": make_channel("hammer", "1", properties={"Amplitude": 99.0})},
            r"RefCh0 does not take Amplitude = 99.0: it is 10.0",
        ),
    ],
)
def test_what_the_device_has_not_is_refused(make_source, change, words):
    with pytest.raises(ParameterError, match=words):
        make_source(replace(PLAN, **change))


def test_a_device_that_is_not_there_is_named_with_the_line():
    table = parse_toml_table('[source]\ndevice = "daqref://device9"\n').take_table("source")
    source = OpenDaqSource(table)
    with pytest.raises(DeviceError, match=r"line 2: openDAQ cannot connect to 'daqref://device9'"):
        source.configure(PLAN)
    source.close()


def test_the_reference_device_is_found():
    assert ADDRESS in [found.address for found in OpenDaqSource.find_devices()]


def test_a_signal_whose_rate_is_changed_by_another_program_is_lost(make_source):
    source = make_source()
    source.device.set_property_value("GlobalSampleRate", 1000.0)
    source.arm()
    with pytest.raises(DeviceError, match=r"is gone: its rate, unit or range was changed"):
        source.read(PATIENCE)


def test_a_device_that_was_removed_is_lost(make_source):
    source = make_source()
    source._instance.remove_device(source.device)
    with pytest.raises(DeviceError, match=r"device0 is gone: it was removed"):
        source.read(PATIENCE)


def test_two_channels_of_one_rate_are_read_at_equal_times(make_source):
    sine = {"Amplitude": 5.0, "Frequency": 100.0}
    plan = replace(
        PLAN,
        hammer=make_channel("hammer", "1", properties=sine),
        specimen=make_channel("specimen", "2", properties=sine),
        continuous=True,
    )
    source = make_source(plan)
    source.arm()
    for block in read_stream(source, 300_000):
        assert np.array_equal(block.hammer.output, block.specimen.output)


def test_the_stream_of_the_full_rate_has_no_gap(make_source, record_property):
    """A second of it; the counter of openDAQ's own tells of every point."""
    source = make_source(replace(PLAN, continuous=True))
    source.arm()
    begin, used = time.monotonic(), time.process_time()
    blocks = read_stream(source, round(RATE))
    share = (time.process_time() - used) / (time.monotonic() - begin)
    record_property("processor share of the full rate, device and driver", round(share, 3))
    place = blocks[0].first_sample
    for block in blocks:
        assert block.first_sample == place
        place += block.hammer.output.size


class Signals:
    """Two signals of openDAQ's own, whose packets a test sends: some of them never come."""

    def __init__(self) -> None:
        context = make_instance().context
        self.values, self.times = [], []
        for name in ("hammer", "specimen"):
            times = opendaq.Signal(context, None, f"{name}_time", None)
            builder = opendaq.DataDescriptorBuilder()
            builder.sample_type = opendaq.SampleType.Int64
            builder.tick_resolution = opendaq.Ratio(1, 4_000_000)
            builder.rule = opendaq.LinearDataRule(4, 0)
            builder.unit = opendaq.Unit(-1, "s", "second", "time")
            self.clock = times.descriptor = builder.build()
            values = opendaq.Signal(context, None, name, None)
            builder = opendaq.DataDescriptorBuilder()
            builder.sample_type = opendaq.SampleType.Int32
            builder.unit = opendaq.Unit(-1, "g", "gravity", "acceleration")
            self.format = values.descriptor = builder.build()
            values.domain_signal = times
            self.values.append(values)
            self.times.append(times)

    def send(self, channel: int, first: int, count: int) -> None:
        """Send points whose value is their number."""
        times, values = self.times[channel], self.values[channel]
        domain = opendaq.DataPacket(self.clock, count, 4 * first)
        times.send_packet(domain)
        packet = opendaq.DataPacketWithDomain(domain, self.format, count, 0)
        np.frombuffer(packet.raw_data, np.int32)[:] = np.arange(first, first + count)
        values.send_packet(packet)


def test_points_that_one_channel_lost_are_a_gap_of_both():
    from impact_rig.devices.opendaq import SignalQueue, read_format, take_common

    signals = Signals()
    views = [opendaq.ISignal.cast_from(signal) for signal in signals.values]
    found = read_format(views[0])
    assert found == SignalFormat(RATE, 4, np.dtype(np.int32), "g", 0.0)
    queues = [SignalQueue(view, opendaq.PacketReader(view), found) for view in views]
    for channel, first, count in (
        (0, 100, 50), (1, 110, 60),              # one begins later
        (0, 150, 50), (1, 190, 10),              # one loses 20
        (0, 230, 10), (1, 230, 10),              # both lose 30
    ):  # fmt: skip
        signals.send(channel, first, count)
    for queue in queues:
        queue.fetch()
    pieces = list(take_common(queues))
    numbers = np.concatenate([values for _, values in pieces])
    wanted = np.concatenate([np.arange(110, 170), np.arange(190, 200), np.arange(230, 240)])
    assert np.array_equal(numbers, np.column_stack([wanted, wanted]))
    assert [tick for tick, values in pieces] == [4 * int(values[0, 0]) for _, values in pieces]


def test_a_jump_of_the_devices_clock_is_a_gap_and_one_back_its_end(make_source):
    source = make_source(replace(PLAN, continuous=True))
    source._stopping.set()
    source._reader.join()
    source.arm()
    place, points = source.count, np.zeros((50, 2))
    expected = source._pass_on(1000, points, None, 1)
    assert source._pass_on(expected + 480, points, expected, 1) == 1580
    assert [block.first_sample - place for block in source.blocks] == [0, 530]
    with pytest.raises(DeviceError, match="its clock went back"):
        source._pass_on(1579, points, 1580, 1)


class ReferenceBench(SourceBench):
    """The reference device, which oscillates for a while where a hammer would strike."""

    driver = OpenDaqSource
    reaches_both = False  # the hammer's channel alone oscillates

    def make_source(self) -> OpenDaqSource:
        self.source = OpenDaqSource(make_table())
        return self.source

    def make_plan(self, *, continuous: bool = False) -> AcquisitionPlan:
        return replace(PLAN, continuous=continuous)

    def strike(self, source: OpenDaqSource) -> None:
        channel = source.device.channels_recursive[0]
        for amplitude in (5.0, 0.0):
            channel.set_property_value("Amplitude", amplitude)
            begin = source.count
            with source.changed:
                # What is on its way yet has the old amplitude.
                assert source.changed.wait_for(
                    lambda begin=begin, amplitude=amplitude: any(
                        block.first_sample > begin
                        and (np.abs(block.hammer.output).max() > 1.0) == (amplitude > 0)
                        for block in source.blocks
                    ),
                    PATIENCE,
                )


class TestOpenDaqSource(AccelerationSourceContract):
    """The contract, on the reference device."""

    @pytest.fixture
    def bench(self) -> ReferenceBench:
        return ReferenceBench()
