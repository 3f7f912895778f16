"""A whole bench that is not there: a relay that holds the hammer, and a digitizer that sees it.

The relay releases, the hammer swings, and the digitizer sees a hit of the virtual rig.
"""

import threading
from collections import Counter
from pathlib import Path

from fakes.relay_board import RelayBoard
from fakes.scpi_digitizer import ScpiDigitizer
from impact_rig.configuration.rig_file import load_rig_file, read_template
from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.sensors import STANDARD_GRAVITY
from impact_rig.core.given.setup import CONTROL_SAMPLE
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings

SWING_TIME = 0.02  # [s], from release to contact, as in the tables: a tenth of the paper's
RIG_TABLES = """
[source]
driver = "scpi"
address = "{address}"
sampling_rate = "2.5 MHz"
trigger_level = "5 g"

[source.hammer]
channel = 1
sensitivity = "5 mV/g"

[source.specimen]
channel = 2
sensitivity = "4 mV/g"

[holder]
driver = "serial"
port = "{port}"
swing_time = "20 ms"
"""
"""The paper's hits take a fifth to three quarters of the digitizer's 1 V."""


class RigBench:
    """Relay, hammer, sample and digitizer, plugged in, and a rig file that names both devices.

    Each strike of a sample is the next of its series, as on a real bench.

    Parameters
    ----------
    rig_file : Path
        Where to write it.
    seed : int
        Of the hits.
    """

    def __init__(self, rig_file: Path, seed: int) -> None:
        self.sample = ""  # the one that is mounted
        self.triggered = 0  # strikes that the digitizer has seen
        self._strikes: Counter[str] = Counter()
        self._rig = VirtualRig(load_rig_file(None).setup, VirtualRigSettings(seed=seed))
        self._rig.strike(HitLabel(CONTROL_SAMPLE))  # the first one imports for seconds
        self.scpi = ScpiDigitizer(5e-3 / STANDARD_GRAVITY, 4e-3 / STANDARD_GRAVITY)
        self.relay = RelayBoard(self._swing)
        self.to_unplug: list[ScpiDigitizer | RelayBoard] = []  # one with each strike
        self.scpi.plug()
        self.relay.plug()
        tables = RIG_TABLES.format(address=self.scpi.address, port=self.relay.port)
        rig_file.write_text(read_template() + tables, "utf-8")

    def close(self) -> None:
        """Put everything away."""
        self.relay.stop()
        self.scpi.unplug()

    def _swing(self) -> None:
        threading.Timer(SWING_TIME, self._strike).start()

    def _strike(self) -> None:
        self._strikes[self.sample] += 1
        impact = self._strikes[self.sample]
        hit = self._rig.strike(HitLabel(self.sample, record=impact, impact=impact))
        if self.scpi.feed(hit):
            self.triggered += 1
            if self.to_unplug:
                self.to_unplug.pop(0).unplug()
