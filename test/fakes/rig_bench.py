"""A whole bench that is not there: a relay that holds the hammer, and a digitizer that sees it.

The relay lets go, the hammer swings, and the digitizer sees a hit of the virtual rig::

    python -m fakes.rig_bench --write bench.toml

It writes a rig file that names both, for `impact-rig up --rig-file bench.toml`. It prints where
they are, and each hit, as lines of JSON, and takes `mount SAMPLE`, `unplug DEVICE`, `plug DEVICE`
and `quit` as lines, where a device is `scpi` or `relay`; each is answered by a line.
"""

import argparse
import json
import sys
import threading
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fakes.relay_board import RelayBoard
from fakes.scpi_digitizer import ScpiDigitizer
from impact_rig.configuration.rig_file import load_rig_file, read_template
from impact_rig.core.errors import RigError
from impact_rig.core.records import HitLabel
from impact_rig.core.sensors import Sensor
from impact_rig.core.setup import CONTROL_SAMPLE, RigSetup
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings

HAMMER_SENSITIVITY = 5e-3
SPECIMEN_SENSITIVITY = 4e-3
"""Of the sensors [V per g], our choice: the paper's hits take a fifth to three quarters of the
digitizer's 1 V."""
SWING_TIME = 0.02
"""From release to contact [s]: a tenth of the paper's, since nobody watches it."""
RIG_TABLES = """
[source]
driver = "scpi"
address = "{address}"
sampling_rate = "2.5 MHz"
trigger_level = "5 g"

[source.hammer]
channel = 1
sensitivity = "{hammer:g} mV/g"

[source.specimen]
channel = 2
sensitivity = "{specimen:g} mV/g"

[holder]
driver = "serial"
port = "{port}"
swing_time = "{swing_time:g} s"
"""


class RigBench:
    """Relay, hammer, sample and digitizer, which know of each other only what a bench knows.

    Nobody tells it of records and attempts: each strike of a sample is the next of its series, as
    on a real bench.

    Parameters
    ----------
    setup : RigSetup
        Masses and samples.
    settings : VirtualRigSettings
        Of the hits.

    Attributes
    ----------
    sample : str
        The one that is mounted; empty: none.
    """

    def __init__(self, setup: RigSetup, settings: VirtualRigSettings) -> None:
        self.sample = ""
        self._rig = VirtualRig(setup, settings)
        self._strikes: Counter[str] = Counter()
        self.scpi = ScpiDigitizer(
            1.0 / Sensor("hammer", "acceleration", "g", HAMMER_SENSITIVITY).compute_scale(),
            1.0 / Sensor("specimen", "acceleration", "g", SPECIMEN_SENSITIVITY).compute_scale(),
        )
        self.relay = RelayBoard(self._let_go)
        self._swing: threading.Timer | None = None

    def start(self) -> None:
        """Be there."""
        self.scpi.plug()
        self.relay.plug()

    def stop(self) -> None:
        """Be gone; a hammer on its way arrives before."""
        self.relay.stop()
        if self._swing is not None:
            self._swing.join()
        self.scpi.unplug()

    def mount(self, sample: str) -> None:
        """Put a sample in the hammer's way; raises `ParameterError` if it cannot be struck."""
        self._rig.check_sample(sample)
        self.sample = sample

    def make_tables(self) -> str:
        """Return the tables [source] and [holder] of a rig file that uses it."""
        return RIG_TABLES.format(
            address=self.scpi.address,
            hammer=HAMMER_SENSITIVITY * 1e3,
            specimen=SPECIMEN_SENSITIVITY * 1e3,
            port=self.relay.port,
            swing_time=SWING_TIME,
        )

    def _let_go(self) -> None:
        self._swing = threading.Timer(SWING_TIME, self._strike)
        self._swing.start()

    def _strike(self) -> None:
        self._strikes[self.sample] += 1
        impact = self._strikes[self.sample]
        hit = self._rig.strike(HitLabel(self.sample, record=impact, impact=impact))
        _tell(hit=hit.label.impact, sample=hit.label.sample, triggered=self.scpi.feed(hit))


def _tell(**fields: Any) -> None:
    # One write for a line: hits are told by another thread than commands are.
    sys.stdout.write(json.dumps(fields) + "\n")
    sys.stdout.flush()


def _obey(bench: RigBench, line: str) -> None:
    """Do what a line says, and tell that it is done or why not."""
    verb, _, name = line.partition(" ")
    devices: dict[str, ScpiDigitizer | RelayBoard]
    devices = {"scpi": bench.scpi, "relay": bench.relay}
    try:
        if verb == "mount":
            bench.mount(name)
        elif verb == "unplug" and name in devices:
            devices[name].unplug()
        elif verb == "plug" and name in devices:
            devices[name].plug()
        else:
            _tell(error=f"unknown command {line!r}: it knows mount SAMPLE, unplug and plug scpi or"
                  " relay, and quit")  # fmt: skip
            return
    except RigError as error:
        _tell(error=str(error))
        return
    _tell(done=line)


def main(argv: Sequence[str] | None = None) -> int:
    """Be a bench until told to quit, or standard input ends."""
    parser = argparse.ArgumentParser(description="A bench that is not there.")
    parser.add_argument(
        "--write", type=Path, required=True, help="where to write a rig file that names it"
    )
    parser.add_argument("--seed", type=int, default=1, help="of the hits' scatter (%(default)s)")
    arguments = parser.parse_args(argv)
    setup = load_rig_file(None).setup
    bench = RigBench(setup, VirtualRigSettings(seed=arguments.seed))
    bench.mount(CONTROL_SAMPLE)
    bench.start()
    try:
        arguments.write.write_text(read_template() + bench.make_tables(), "utf-8")
        _tell(scpi=bench.scpi.address, relay=bench.relay.port)
        for line in sys.stdin:
            if line.strip() == "quit":
                break
            _obey(bench, line.strip())
    except KeyboardInterrupt:
        pass
    finally:
        bench.stop()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
