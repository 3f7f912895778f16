"""A digitizer that speaks Red Pitaya's SCPI over a real TCP socket, without any hardware.

As a process it strikes a sample of the virtual rig when it is told to::

    python -m impact_rig.devices.peers.scpi_digitizer --sample "steel small"

It prints its address, and each strike, as a line of JSON, and takes `strike`, `unplug`, `plug` and
`quit` as lines.
"""

import argparse
import json
import sys
import threading
import time
from enum import Enum
from itertools import count

import numpy as np

from impact_rig.configuration.units import parse_sensitivity
from impact_rig.core.errors import RigError
from impact_rig.core.setup.calibration import find_scale
from impact_rig.core.setup.paper import CONTROL_SAMPLE, PAPER_SETUP
from impact_rig.core.signals.pulse_search import to_acceleration
from impact_rig.core.signals.record import ChannelBlock, FloatArray, HitLabel
from impact_rig.devices.peers.line_server import LineServer
from impact_rig.devices.peers.red_pitaya import RedPitaya
from impact_rig.devices.virtual.choices import Fault
from impact_rig.devices.virtual.rig import VirtualHit, VirtualRig, VirtualRigSettings

END = b"\r\n"
NONSENSE = b"\x00\xffQX!"
SENSITIVITY = "4 mV/g"
"""At which the paper's hits stay within the inputs' 1 V."""


class ScpiFault(Enum):
    """How an instrument may misbehave when it is asked."""

    NONE = "nothing"
    SILENT = "it does not answer"
    HALF = "it sends half of its answer"
    CUT = "it sends half of its answer and closes the connection"
    NONSENSE = "its answer makes no sense"


class ScpiDigitizer:
    """The instrument, with the hammer's sensor on its input 1 and the sample's on input 2.

    Parameters
    ----------
    hammer_sensitivity, specimen_sensitivity : float
        Of the sensors, signed [V per m/s^2].
    port : int
        Of the loopback interface; 0: any that is free.
    """

    def __init__(
        self, hammer_sensitivity: float, specimen_sensitivity: float, port: int = 0
    ) -> None:
        self._sensitivities = (hammer_sensitivity, specimen_sensitivity)
        self._server = LineServer(self._take, port)
        self._lock = threading.Lock()
        self._board = RedPitaya()
        self._fault, self._fault_on = ScpiFault.NONE, ""

    @property
    def address(self) -> str:
        """Where it listens: host and port."""
        return self._server.address

    def start(self) -> None:
        """Be there."""
        self._server.open()

    def stop(self) -> None:
        """Be gone for good."""
        self._server.close()

    def unplug(self) -> None:
        """Let listener and connections vanish at once."""
        self._server.close()

    def plug(self) -> None:
        """Come back at the same address, switched on anew."""
        with self._lock:
            self._board.reset()
        self._server.open()

    def feed(self, hit: VirtualHit) -> float | None:
        """Let the hammer strike now.

        Returns
        -------
        float or None
            When the record will be complete in the instrument, seconds since the epoch; None: it
            does not trigger.
        """
        if Fault.MISSED_TRIGGER in hit.faults:
            return None
        hammer, specimen = (
            sensitivity * _find_acceleration(channel, hit.hammer.output.size)
            for sensitivity, channel in zip(
                self._sensitivities, (hit.hammer, hit.specimen), strict=True
            )
        )
        with self._lock:
            wait = self._board.strike(np.stack([hammer, specimen]), hit.sampling_rate)
            return None if wait is None else time.time() + wait

    def misbehave(self, fault: ScpiFault, on: str = "") -> None:
        """Answer wrongly from now on, where the command contains `on`."""
        with self._lock:
            self._fault, self._fault_on = fault, on

    def set_identity(self, identity: str) -> None:
        """Answer this to ``*IDN?``, as another instrument."""
        with self._lock:
            self._board.identity = identity

    def set_busy(self, *, is_busy: bool) -> None:
        """Close every connection as soon as it is made, as if somebody else had it, or not."""
        self._server.is_busy = is_busy

    def _take(self, line: bytes) -> tuple[bytes, bool]:
        """Return the answer to a line, and whether the connection goes on."""
        text = line.decode("latin-1")
        with self._lock:
            answer = self._board.answer(text)
            fault = self._fault if self._fault_on in text else ScpiFault.NONE
        if answer is None or fault is ScpiFault.SILENT:
            return b"", True
        if fault is ScpiFault.NONSENSE:
            return NONSENSE + END, True
        if fault in {ScpiFault.HALF, ScpiFault.CUT}:
            return answer[: (len(answer) + 1) // 2], fault is ScpiFault.HALF
        return answer + END, True


def _find_acceleration(channel: ChannelBlock, size: int) -> FloatArray:
    """Return what a channel of a hit means [m/s^2], zero where it is not measured."""
    if not channel.output.size:
        return np.zeros(size)
    return to_acceleration(channel, channel.output)


def _parse_sensitivity(text: str) -> float:
    """Return the voltage of 1 m/s^2."""
    try:
        return 1.0 / find_scale("V", sensitivity=parse_sensitivity("sensitivity", text))
    except RigError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="A digitizer that speaks SCPI, and its hammer.")
    parser.add_argument("--port", type=int, default=0, help="to listen on; 0: any")
    parser.add_argument("--hammer", type=_parse_sensitivity, default=SENSITIVITY,
                        help="sensitivity of the hammer's sensor (%(default)s)")  # fmt: skip
    parser.add_argument("--specimen", type=_parse_sensitivity, default=SENSITIVITY,
                        help="sensitivity of the sample's sensor (%(default)s)")  # fmt: skip
    parser.add_argument("--sample", default=CONTROL_SAMPLE, help="that is struck")
    parser.add_argument("--seed", type=int, default=1, help="of the hits' scatter")
    return parser.parse_args()


def main() -> None:
    """Do what standard input says until it ends."""
    arguments = _parse_arguments()
    rig = VirtualRig(PAPER_SETUP, VirtualRigSettings(seed=arguments.seed))
    digitizer = ScpiDigitizer(arguments.hammer, arguments.specimen, arguments.port)
    digitizer.start()
    print(json.dumps({"address": digitizer.address}), flush=True)
    impacts = count(1)
    for line in sys.stdin:
        match line.strip():
            case "strike":
                impact = next(impacts)
                complete = digitizer.feed(rig.strike(HitLabel(arguments.sample, impact=impact)))
                print(json.dumps({"impact": impact, "complete": complete}), flush=True)
            case "unplug":
                digitizer.unplug()
            case "plug":
                digitizer.plug()
            case "quit":
                break
    digitizer.stop()


if __name__ == "__main__":
    main()
