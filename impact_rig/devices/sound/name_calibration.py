"""The calibration that USB accelerometers of The Modal Shop carry in their device name.

Models 333D, 485B, 633A and SDC0: model, a character, the format, the serial number, and the
sensitivity of both channels in counts of 24 bits, then the date. Format 1 is an accelerometer
[counts per m/s^2], 2 a voltage input [counts per V], 3 one of twenty times that (their USB Audio
Interface Guide, MAN-0343).
"""

import re
from dataclasses import dataclass

_NAME = re.compile(
    r"(?:333D|485B|633A|SDC0)..."
    r"(?:(?P<format>1)(?P<serial>.{6})(?P<a>\d{5})(?P<b>\d{5})(?P<date>\d{6})"
    r"|(?P<wide>[23]).{6}(?P<wide_a>\d{7})(?P<wide_b>\d{7})\d{6})"
)
_FULL_COUNT = 2**23
"""Counts of the sensitivity at full scale [-]."""
_FACTORS = {"2": 1, "3": 20}


@dataclass(frozen=True)
class NameCalibration:
    """Of one channel.

    Attributes
    ----------
    unit : str
        "m/s^2" or "V".
    full_scale : float
        At the largest count [unit].
    """

    unit: str
    full_scale: float


def find_name_calibrations(name: str) -> tuple[NameCalibration, ...]:
    """Return what a device's name says of its channels; empty: nothing."""
    match = _NAME.search(name)
    if match is None:
        return ()
    if match["format"]:
        unit, sensitivities = "m/s^2", (int(match["a"]), int(match["b"]))
    else:
        factor = _FACTORS[match["wide"]]
        unit = "V"
        sensitivities = (factor * int(match["wide_a"]), factor * int(match["wide_b"]))
    if not all(sensitivities):
        return ()
    return tuple(NameCalibration(unit, _FULL_COUNT / value) for value in sensitivities)
