"""A device of openDAQ on a network of its own, whose sensors see the virtual rig's hits.

The server, its packets and its streaming are openDAQ's; two of its function blocks pass on what
this program gives them at 1 MS/s. It is run as a program in a network namespace, since openDAQ's
server listens on all networks: ``unshare --net python -m fakes.opendaq_bench FOLDER``. It prints
its process number when it is ready; each line that it reads names the sample that is mounted.
"""

import os
import subprocess
import sys
import threading
import time
from collections import Counter
from pathlib import Path

import numpy as np
import opendaq

from fakes.relay_board import RelayBoard
from impact_rig.configuration.rig_file import read_template
from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.sensors import STANDARD_GRAVITY
from impact_rig.core.given.setup import CONTROL_SAMPLE, PAPER_SETUP
from impact_rig.devices.opendaq import make_instance
from impact_rig.devices.speed_gate import SpeedGate
from impact_rig.devices.virtual.rig import DigitizerSettings, VirtualRig, VirtualRigSettings

RATE = 1_000_000  # [Hz], the fastest of openDAQ's reference device
SENSITIVITY = 0.02  # [V/g]
NOISE = 1e-3  # [V]
SWING_TIME = 0.02  # [s], from release to contact
SERVER = "OpenDAQNativeStreaming"
RIG_TABLES = """
[source]
driver = "opendaq"
device = "daq.nd://127.0.0.1/"
sampling_rate = "1 MHz"
trigger_level = "5 g"

[source.hammer]
channel = "RefFBModuleScaling_1/Sig/output"
sensitivity = "20 mV/g"
full_scale = "200 g"

[source.specimen]
channel = "RefFBModuleScaling_2/Sig/output"
sensitivity = "20 mV/g"
full_scale = "400 g"

[source.impact_speed]
channel = "RefFBModuleScaling_3/Sig/output"
level = 2.5
distance = "5 mm"
distance_uncertainty = "10 um"

[holder]
driver = "serial"
port = "{port}"
swing_time = "20 ms"
"""


PRE_TRIGGER, LEAD = 1e-3, 0.1  # [s], of a hit's record, and before it: the flag passes
BARRIER = SpeedGate("", 2.5, 5e-3, 10e-6, 2, PAPER_SETUP.pendulum_rate)


def make_rig(seed: int) -> VirtualRig:
    """Return what the sensors see."""
    digitizer = DigitizerSettings(
        sampling_rate=RATE, pre_trigger=PRE_TRIGGER, record_duration=4e-3, offset=0.0
    )
    settings = VirtualRigSettings(seed=seed, digitizer=digitizer, gate=BARRIER)
    return VirtualRig(PAPER_SETUP, settings)


class Stream:
    """Two signals of a device, sent all the time."""

    def __init__(self) -> None:
        self._instance = make_instance()
        context = self._instance.context
        self._clock = opendaq.Signal(context, None, "time", None)
        builder = opendaq.DataDescriptorBuilder()
        builder.sample_type = opendaq.SampleType.Int64
        builder.tick_resolution = opendaq.Ratio(1, RATE)
        builder.rule = opendaq.LinearDataRule(1, 0)
        builder.unit = opendaq.Unit(-1, "s", "second", "time")
        self._clock.descriptor = self._ticks = builder.build()
        builder = opendaq.DataDescriptorBuilder()
        builder.sample_type = opendaq.SampleType.Float64
        builder.unit = opendaq.Unit(-1, "V", "volt", "voltage")
        builder.value_range = opendaq.Range(-10, 10)
        self._format = builder.build()
        self._signals = []
        for name in ("hammer", "specimen", "barrier"):
            signal = opendaq.Signal(context, None, name, None)
            signal.descriptor, signal.domain_signal = self._format, self._clock
            block = self._instance.add_function_block("RefFBModuleScaling")
            block.input_ports[0].connect(opendaq.ISignal.cast_from(signal))
            self._signals.append(signal)
        types = {
            str(name): kind
            for module in self._instance.module_manager.modules
            for name, kind in opendaq.IModule.cast_from(module).available_server_types.items()
        }
        config = opendaq.IServerType.cast_from(types[SERVER]).create_default_config()
        self._instance.add_server(SERVER, config)
        self._hits: list[np.ndarray] = []  # [V], shape (3, n)
        self._lock = threading.Lock()
        threading.Thread(target=self._send_all, daemon=True).start()

    def strike(self, volts: np.ndarray) -> None:
        """Let sensors and barrier see a hit, shape (3, n), with the next packet."""
        with self._lock:
            self._hits.append(volts)

    def _send_all(self) -> None:
        noise = np.random.default_rng(1)
        begin, sent = time.monotonic(), 0
        while True:
            time.sleep(0.01)
            count = round((time.monotonic() - begin) * RATE) - sent
            with self._lock:
                hits, self._hits = self._hits, []
            count = max(count, *(hit.shape[1] for hit in hits), 1)
            values = NOISE * noise.standard_normal((3, count))
            for hit in hits:
                values[:, : hit.shape[1]] = hit
            ticks = opendaq.DataPacket(self._ticks, count, sent)
            self._clock.send_packet(ticks)
            for signal, row in zip(self._signals, values, strict=True):
                packet = opendaq.DataPacketWithDomain(ticks, self._format, count, 0)
                np.frombuffer(packet.raw_data, np.float64)[:] = row
                signal.send_packet(packet)
            sent += count


class OpenDaqBench:
    """A relay that holds the hammer, and the device; a rig file that names both."""

    def __init__(self, rig_file: Path, seed: int) -> None:
        self.sample = ""
        self._strikes: Counter[str] = Counter()
        self._rig = make_rig(seed)
        self._rig.strike(HitLabel(CONTROL_SAMPLE))  # the first one imports for seconds
        self._stream = Stream()
        self.relay = RelayBoard(lambda: threading.Timer(SWING_TIME, self._strike).start())
        self.relay.plug()
        tables = RIG_TABLES.format(port=self.relay.port)
        rig_file.write_text(read_template() + tables, "utf-8")

    def _strike(self) -> None:
        self._strikes[self.sample] += 1
        impact = self._strikes[self.sample]
        hit = self._rig.strike(HitLabel(self.sample, record=impact, impact=impact))
        lead = round(LEAD * RATE)
        signals = np.zeros((3, lead + hit.hammer.output.size))
        signals[0, lead:], signals[1, lead:] = hit.hammer.acceleration, hit.specimen.acceleration
        signals[:2] *= SENSITIVITY / STANDARD_GRAVITY
        # From its lowest point on, a pendulum is (v / w) sin(w t) away.
        ways = np.array([0.5e-3 + BARRIER.distance, 0.5e-3]) * BARRIER.rate / hit.speed.value
        first, last = LEAD + PRE_TRIGGER - np.arcsin(ways) / BARRIER.rate
        signals[2, round(first * RATE) : round(last * RATE)] = 5.0
        self._stream.strike(signals)


def main() -> None:
    """Serve until standard input ends."""
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    bench = OpenDaqBench(Path(sys.argv[1], "bench.toml"), int(sys.argv[2]))
    print(os.getpid(), flush=True)
    for line in sys.stdin:
        bench.sample = line.strip()
    bench.relay.stop()


if __name__ == "__main__":
    main()
