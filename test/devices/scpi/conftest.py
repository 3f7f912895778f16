"""An instrument on a real socket, rig files for it, and a hammer that strikes."""

from collections.abc import Iterator
from itertools import count

import numpy as np
import pytest

from impact_rig.configuration.toml_table import TomlTable, parse_toml_table
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.setup.sensors import Sensor
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.drivers import COMMON_KEYS, SOURCES
from impact_rig.devices.protocols import AcquisitionPlan, SourceChannel
from impact_rig.devices.scpi.source import ScpiSource
from impact_rig.devices.virtual.rig import VirtualHit, VirtualRig, VirtualRigSettings
from impact_rig.testing.peers.scpi_digitizer import ScpiDigitizer

SENSITIVITIES = {"hammer": 5e-4, "specimen": -2.5e-4}
"""[V per m/s^2]: one count of a hit is a whole number of the instrument's."""
NUMBERS = {"hammer": "1", "specimen": "2"}
SAMPLE = "aluminium large"


class ScpiRig:
    """An instrument and what is around it."""

    def __init__(self) -> None:
        self.digitizer = ScpiDigitizer(*SENSITIVITIES.values())
        self._rig = VirtualRig(PAPER_SETUP, VirtualRigSettings())
        self._impacts = count(1)
        self.sources = []

    def make_hit(self) -> VirtualHit:
        return self._rig.strike(HitLabel(SAMPLE, impact=next(self._impacts)))

    def strike(self) -> VirtualHit:
        hit = self.make_hit()
        assert self.digitizer.feed(hit) is not None
        return hit

    def make_source(self, text: str = "", address: str = "") -> ScpiSource:
        """Return the source of a rig file whose [source] has an address and a text."""
        table = self.parse(f'address = "{address or self.digitizer.address}"\n{text}')
        self.sources.append(ScpiSource(table.without(*COMMON_KEYS[SOURCES])))
        return self.sources[-1]

    def make_plan(self, text: str = "", numbers=NUMBERS, **changes) -> AcquisitionPlan:
        """Return the plan of a rig file whose [source] has a text and these channels."""
        table = self.parse(text)
        channels = {
            name: SourceChannel(
                number,
                Sensor(name, sensitivity=changes.pop(f"{name}_sensitivity", SENSITIVITIES[name])),
                options=table.take_table(name).without("channel"),
            )
            for name, number in numbers.items()
        }
        values = {
            "sampling_rate": 2.5e6,
            "record_duration": 2e-3,
            "pre_trigger": 3e-4,
            "trigger_level": 49.0,
            "specimen": None,
            **channels,
        }
        return AcquisitionPlan(**(values | changes))

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


GENERIC = """
profile = "generic"
setup = ["ACQ:RST", "ACQ:DEC:FACTOR 50", "ACQ:TRIG:LEV {level}", "ACQ:TRIG:DLY -3942",
         "ACQ:DATA:UNITS RAW", "ACQ:DATA:FORMAT BIN"]
start = ["ACQ:TRIG DISABLED", "ACQ:START"]
arm = ["ACQ:TRIG CH{hammer}_PE"]
state = "ACQ:TRIG:FILL?"
complete = "1"
disarm = ["ACQ:TRIG DISABLED", "ACQ:STOP"]
fetch = ["ACQ:SOUR{channel}:DATA:LATEST:N? {points}"]
"""
"""The same instrument, by its commands."""
CHANNELS = """
[source.hammer]
range = "1 V"
scale = "0.1220703125 mV"
[source.specimen]
range = "1 V"
scale = "0.1220703125 mV"
"""


@pytest.fixture(params=["red_pitaya", "generic"])
def profile(request, rig: ScpiRig):
    """Return a function that makes a source and its plan, for each profile."""
    text, channels = (GENERIC, CHANNELS) if request.param == "generic" else ("", "")

    def make(more: str = "", **changes):
        return rig.make_source(text + more), rig.make_plan(channels, **changes)

    return make
