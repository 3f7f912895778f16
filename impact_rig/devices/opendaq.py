"""Devices of the makers who use the openDAQ software: the driver `opendaq`."""

import math
import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.core.given.errors import DeviceError
from impact_rig.core.given.sensors import VOLTAGES, compute_scale, normalize_unit
from impact_rig.devices.drivers import read_example
from impact_rig.devices.protocols import AcquisitionPlan, ChannelScale, FoundDevice, SourceChannel
from impact_rig.devices.speed_gate import SpeedGate
from impact_rig.devices.streaming import StreamedSource

RATE_PROPERTIES = ("SampleRate", "GlobalSampleRate")
"""Makers' names of the sampling rate, of a device or of each channel."""
RATE_TOLERANCE = 0.01  # relative; within it the clock's own rate is used
SETTLING = 3.0  # [s], in which a device on the network tells its new rate
POLL_PERIOD = 0.01  # [s], between two looks for packets
CHECK_PERIOD = 0.5  # [s], between two looks at the connection
RAIL = 1.0 - 2.0**-15  # [-], part of the range from which on a channel is overloaded
SIMULATED_MODELS = ("Reference device", "Simulator device")
"""Devices of openDAQ itself, which compute what they deliver."""
SOUND_CARDS = "miniaudio://"
"""Begin of their addresses; they have a driver of their own."""
SAMPLE_TYPES = {
    "Float32": np.float32, "Float64": np.float64, "Int8": np.int8, "Int16": np.int16,
    "Int32": np.int32, "Int64": np.int64, "UInt8": np.uint8, "UInt16": np.uint16,
    "UInt32": np.uint32, "UInt64": np.uint64,
}  # fmt: skip
"""Types of numbers, by openDAQ's names."""


@dataclass(frozen=True)
class SignalFormat:
    """Format of a signal's packets."""

    sampling_rate: float  # [Hz]
    step: int  # [ticks], of the domain, from point to point
    dtype: np.dtype[Any]
    unit: str  # as the device writes it
    limit: float  # largest value, either sign [unit]; 0: not given


def read_format(signal: Any) -> SignalFormat:
    """Return the format of a signal's packets.

    Raises
    ------
    DeviceError
        If it is no row of numbers at even times.
    """
    values = signal.descriptor
    domain = signal.domain_signal
    times = domain.descriptor if domain is not None else None
    type_name = values.sample_type.name if values is not None else "none"
    if times is None or times.rule.type.name != "Linear" or type_name not in SAMPLE_TYPES:
        raise DeviceError(
            f"signal {signal.global_id} delivers {type_name}: the rig needs numbers at even times"
        )
    step = float(times.rule.parameters["delta"])
    tick = times.tick_resolution
    limits = values.value_range
    return SignalFormat(
        sampling_rate=float(tick.denominator) / (float(tick.numerator) * step),
        step=round(step),
        dtype=np.dtype(SAMPLE_TYPES[type_name]),
        unit=values.unit.symbol if values.unit is not None else "",
        limit=min(abs(float(limits.low_value)), abs(float(limits.high_value))) if limits else 0.0,
    )


def make_scale(channel: SourceChannel, found: SignalFormat) -> ChannelScale:
    """Return the acceleration of a channel's numbers.

    Raises
    ------
    ParameterError
        If the sensor's sheet does not fit to what the channel delivers, or neither tells the
        range.
    """
    sensor, options = channel.sensor, channel.options
    unit = normalize_unit(found.unit)
    with options.locating():
        if unit in VOLTAGES:
            scale = VOLTAGES[unit] * channel.compute_scale()
        else:
            scale = compute_scale(unit, channel.moving_mass)
    if unit not in VOLTAGES and not math.isnan(sensor.sensitivity):
        raise options.make_error(
            "sensitivity",
            f"sensitivity of {options.place}: channel {channel.name} delivers {found.unit} and"
            " not V, leave sensitivity out",
        )
    mechanical = sensor.compute_full_scale(channel.moving_mass)
    electrical = abs(scale) * found.limit
    full_scale = min(filter(None, (mechanical, electrical)), default=0.0)
    if not full_scale:
        raise options.make_error(
            "full_scale",
            f"{options.place} lacks full_scale, and channel {channel.name} does not tell its"
            ' range: add full_scale = "500 g"',
        )
    return ChannelScale(scale, full_scale, RAIL * (found.limit or full_scale / abs(scale)))


@dataclass
class SignalQueue:
    """Received points of one signal that are not passed on yet."""

    signal: Any
    reader: Any
    found: SignalFormat
    pieces: deque[tuple[int, NDArray[Any]]] = field(default_factory=deque)  # first tick, values

    def fetch(self) -> None:
        """Take the packets that have come.

        Raises
        ------
        DeviceError
            If the signal is not what it was.
        """
        import opendaq

        for packet in self.reader.read_all():
            if packet.type == opendaq.PacketType.Data:
                data = opendaq.IDataPacket.cast_from(packet)
                values = np.frombuffer(data.data, self.found.dtype)
                # A copy: openDAQ uses the packet's memory again.
                self.pieces.append((int(data.domain_packet.offset), values.astype(np.float64)))
            elif read_format(self.signal) != self.found:
                raise DeviceError("its rate, unit or range was changed")

    def drop(self, tick: int) -> None:
        """Forget the points before a tick."""
        while self.pieces:
            first, values = self.pieces.popleft()
            count = max(-(-(tick - first) // self.found.step), 0)
            if count < values.size:
                self.pieces.appendleft((first + count * self.found.step, values[count:]))
                return

    def take(self, count: int) -> NDArray[Any]:
        """Return the next `count` points, which the first piece has."""
        first, values = self.pieces.popleft()
        if count < values.size:
            self.pieces.appendleft((first + count * self.found.step, values[count:]))
        return values[:count]


def take_common(queues: list[SignalQueue]) -> Iterator[tuple[int, NDArray[Any]]]:
    """Yield the first tick, and points of all signals at equal times, shape (n, signals)."""
    while all(queue.pieces for queue in queues):
        heads = [queue.pieces[0] for queue in queues]
        latest = max(tick for tick, _ in heads)
        if any(tick + queues[0].found.step <= latest for tick, _ in heads):
            for queue in queues:
                queue.drop(latest)
            continue
        count = min(values.size for _, values in heads)
        yield latest, np.column_stack([queue.take(count) for queue in queues])


def make_instance() -> Any:
    """Return openDAQ with its modules, which prints nothing; raises `ModuleNotFoundError`."""
    import opendaq

    builder = opendaq.InstanceBuilder()
    builder.global_log_level = opendaq.LogLevel.Off
    return opendaq.InstanceFromBuilder(builder)


class OpenDaqSource(StreamedSource):
    """Reads two channels of an openDAQ device all the time, and cuts the hits out of them.

    Packets carry the time of their first point in ticks of the device's clock: a jump is a gap.
    """

    description: ClassVar[str] = "devices of all makers with openDAQ, Dewesoft's among them"
    measures_speed: ClassVar[bool] = True
    example: ClassVar[str] = read_example("opendaq_source")

    def __init__(self, options: TomlTable) -> None:
        super().__init__()
        options.check_keys("device", "properties")
        self._options = options
        self._address = options.take_text("device", REQUIRED, "daqref://device0")
        self._properties = options.take_table("properties")
        self._instance: Any = None
        self._device: Any = None
        self._stopping = threading.Event()
        self._reader: threading.Thread | None = None

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return the devices that answer on this computer and its networks."""
        instance = make_instance()
        return tuple(
            FoundDevice(item.connection_string, " ".join(filter(None, _list_names(item))))
            for item in instance.available_devices
            if not item.connection_string.startswith(SOUND_CARDS)
        )

    @property
    def device(self) -> Any:
        """The open device, as openDAQ has it."""
        return self._device

    def open_device(self, plan: AcquisitionPlan) -> None:
        """Connect to the device, set it up, and begin to read.

        Raises
        ------
        DeviceError
            If it is not there, or its channels do not run together.
        ParameterError
            If it does not take rate, channel or property.
        """
        self._instance = make_instance()
        try:
            self._device = self._instance.add_device(self._address)
        except RuntimeError as error:
            raise self._make_error(
                "device",
                f"openDAQ cannot connect to {self._address!r} ({_describe(error)}): `impact-rig"
                " devices opendaq` lists what it finds, and another program may have it",
            ) from None
        self.name = f"openDAQ device {self._describe_device()}"
        chosen = [self._choose_channel(channel) for channel in plan.inputs]
        channels, signals = [item for item, _ in chosen], [item for _, item in chosen]
        self._check_signals(plan.inputs, signals)
        self._set_rate(plan.sampling_rate, channels)
        set_properties(self._device, self._properties)
        for channel, wanted in zip(channels, plan.inputs, strict=True):
            wanted.options.check_keys("properties")
            set_properties(channel, wanted.options.take_table("properties"))
        formats = self._read_formats(signals, plan.sampling_rate)
        self.sampling_rate = formats[0].sampling_rate
        self.scales = tuple(map(make_scale, plan.channels, formats))
        if plan.gate is not None:
            self.gate_unit = 1.0 / VOLTAGES.get(normalize_unit(formats[-1].unit), 1.0)
        self._start(signals, formats)

    def close(self) -> None:
        """Stop reading, and let the device go."""
        self._stopping.set()
        reader, self._reader = self._reader, None
        if reader is not None:
            reader.join()
        device, self._device = self._device, None
        instance, self._instance = self._instance, None
        if device is not None:
            with suppress(RuntimeError):
                instance.remove_device(device)

    def _make_error(self, key: str, text: str) -> DeviceError:
        return DeviceError(str(self._options.make_error(key, text)))

    def _describe_device(self) -> str:
        """Return maker, model and serial number, and note whether it computes its numbers."""
        devices = [self._device, *self._device.devices]
        self.is_simulated = any(item.info.model in SIMULATED_MODELS for item in devices)
        names = [name for item in devices for name in _list_names(item.info) if name]
        return f"{' '.join(dict.fromkeys(names)) or self._device.name} at {self._address}"

    def _choose_channel(self, wanted: SourceChannel | SpeedGate) -> tuple[Any, Any]:
        """Return a channel, or a function block that computes, and its signal."""
        channels = list(self._device.channels_recursive)
        for number, channel in enumerate(channels, start=1):
            if wanted.name in (str(number), channel.name, channel.local_id, channel.global_id):
                signals = [item for item in channel.signals if item.domain_signal is not None]
                if not signals:
                    raise DeviceError(f"channel {channel.name} of {self.name} has no signal")
                return channel, signals[0]
        for signal in self._device.get_signals_recursive():
            if signal.global_id.endswith(f"/{wanted.name.lstrip('/')}"):
                return signal, signal
        names = ", ".join(channel.name for channel in channels)
        raise wanted.options.make_error(
            "channel",
            f"channel of {wanted.options.place} is {wanted.name!r}: {self.name} has"
            f" {names or 'none'}, or their numbers from 1, or the end of a signal's path",
        )

    def _check_signals(
        self, inputs: Sequence[SourceChannel | SpeedGate], signals: list[Any]
    ) -> None:
        """Raise `ParameterError` if two inputs name one signal, as 1 and its name do."""
        seen: dict[str, str] = {}
        for wanted, signal in zip(inputs, signals, strict=True):
            place = wanted.options.place
            if signal.global_id in seen:
                raise wanted.options.make_error(
                    "channel",
                    f"channel of {place} is {wanted.name!r}, which is that of"
                    f" {seen[signal.global_id]}: give each a channel of its own",
                )
            seen[signal.global_id] = place

    def _set_rate(self, rate: float, channels: list[Any]) -> None:
        """Ask devices or, where they have no rate, channels for a rate."""
        for owners in ([self._device, *self._device.devices], channels):
            found = [
                (owner, name)
                for owner in owners
                for name in RATE_PROPERTIES
                if owner.has_property(name) and not owner.get_property(name).read_only
            ]
            for owner, name in found:
                with suppress(RuntimeError):  # what it got is read back
                    owner.set_property_value(name, rate)
            if found:
                return

    def _read_formats(self, signals: list[Any], wanted: float) -> list[SignalFormat]:
        """Return the signals' rate; raises `ParameterError` unless it is the wanted one."""
        deadline = time.monotonic() + SETTLING
        while True:
            formats = [read_format(signal) for signal in signals]
            rates = [found.sampling_rate for found in formats]
            if max(abs(rate / wanted - 1.0) for rate in rates) <= RATE_TOLERANCE:
                break
            if time.monotonic() > deadline:
                told = " and ".join(f"{rate:.9g} Hz" for rate in dict.fromkeys(rates))
                raise self._options.make_error(
                    "sampling_rate",
                    f"sampling_rate of {self._options.place} is {wanted:.9g} Hz: {self.name}"
                    f" samples at {told}; write that rate, or set the device to another",
                )
            time.sleep(POLL_PERIOD)
        if len({(found.sampling_rate, found.step) for found in formats}) > 1:
            raise DeviceError(
                f"the channels of {self.name} sample at"
                f" {' and '.join(f'{rate:.9g}' for rate in rates)} Hz: give all the same rate"
            )
        return formats

    def _start(self, signals: list[Any], formats: list[SignalFormat]) -> None:
        import opendaq

        queues = [
            SignalQueue(signal, opendaq.PacketReader(signal), found)
            for signal, found in zip(signals, formats, strict=True)
        ]
        self._stopping = threading.Event()
        self._reader = threading.Thread(
            target=self._read_all, args=(queues, self._stopping), name="opendaq", daemon=True
        )
        self._reader.start()

    def _read_all(self, queues: list[SignalQueue], stopping: threading.Event) -> None:
        """Pass on what comes, until the device has gone; the reader's thread."""
        expected: int | None = None
        looked = time.monotonic()
        try:
            while not stopping.wait(POLL_PERIOD):
                for queue in queues:
                    queue.fetch()
                for tick, values in take_common(queues):
                    expected = self._pass_on(tick, values, expected, queues[0].found.step)
                if time.monotonic() - looked > CHECK_PERIOD:
                    looked = time.monotonic()
                    check_connection(self._device)
        except (DeviceError, RuntimeError) as error:
            self.end(_describe(error))

    def _pass_on(self, tick: int, values: NDArray[Any], expected: int | None, step: int) -> int:
        """Take points, and the gap before them; return the tick of the next ones."""
        lost = 0 if expected is None else round((tick - expected) / step)
        if lost < 0:
            raise DeviceError("its clock went back")
        age = len(values) / self.sampling_rate
        self.take(values, round((time.time() - age) * 1e9), lost)
        return tick + len(values) * step


def set_properties(owner: Any, table: TomlTable) -> None:
    """Set what the rig file says, and read it back.

    Raises
    ------
    ParameterError
        If device or channel has no such property, or does not take the value; names the line.
    """
    for name, value in table.items():
        if not owner.has_property(name):
            known = ", ".join(item.name for item in owner.visible_properties)
            raise table.make_error(name, f"{owner.name} has no property {name!r}: it has {known}")
        trouble = ""
        try:
            owner.set_property_value(name, value)
        except RuntimeError as error:
            trouble = f" ({_describe(error)})"
        found = owner.get_property_value(name)
        if trouble or found != value:
            raise table.make_error(
                name, f"{owner.name} does not take {name} = {value!r}: it is {found!r}{trouble}"
            )


def check_connection(device: Any) -> None:
    """Raise `DeviceError` if a device on the network is not connected, or was removed."""
    import opendaq

    if opendaq.IRemovable.cast_from(device).removed:
        raise DeviceError("it was removed")
    for name, status in device.connection_status_container.statuses.items():
        state = str(status).rpartition(".")[2]
        if state != "Connected":
            raise DeviceError(f"{name} is {state}")


def _list_names(info: Any) -> tuple[str, str, str]:
    return info.manufacturer, info.model, info.serial_number


def _describe(error: Exception) -> str:
    return " ".join(str(error).split()).rstrip(".")
