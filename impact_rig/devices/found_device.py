"""What a search for devices finds."""

from dataclasses import dataclass


@dataclass(frozen=True)
class FoundDevice:
    """A device that a driver could use.

    Attributes
    ----------
    address : str
        As the rig file names it: "Dev1", "/dev/ttyUSB0".
    identity : str
        Model and serial number, as far as they are known without opening it.
    """

    address: str
    identity: str = ""
