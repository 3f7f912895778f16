"""A digitizer that speaks SCPI, as a process: it strikes a sample for each line that it takes.

It prints its address, and when the record of each strike is complete, as lines of JSON.
"""

import json
import sys

from impact_rig.configuration.units import parse_sensitivity
from impact_rig.core.setup.calibration import compute_scale
from impact_rig.core.setup.paper import CONTROL_SAMPLE, PAPER_SETUP
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.testing.peers.scpi_digitizer import ScpiDigitizer

SENSITIVITY = "4 mV/g"
"""Of both sensors: the hits stay within the inputs' 1 V."""


def main() -> None:
    """Strike whenever standard input says so, until it ends."""
    rig = VirtualRig(PAPER_SETUP, VirtualRigSettings())
    volts = 1.0 / compute_scale("V", sensitivity=parse_sensitivity("sensitivity", SENSITIVITY))
    digitizer = ScpiDigitizer(volts, volts)
    digitizer.plug()
    print(json.dumps({"address": digitizer.address}), flush=True)
    for impact, _ in enumerate(sys.stdin, start=1):
        complete = digitizer.feed(rig.strike(HitLabel(CONTROL_SAMPLE, impact=impact)))
        print(json.dumps({"impact": impact, "complete": complete}), flush=True)
    digitizer.unplug()


if __name__ == "__main__":
    main()
