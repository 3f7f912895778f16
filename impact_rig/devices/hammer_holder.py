"""What a driver of a hammer holder must do."""

from enum import Enum
from typing import ClassVar, Protocol

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.devices.found_device import FoundDevice


class HolderState(Enum):
    """What a holder does."""

    HOLDING = "holding"
    RELEASED = "released"


class HammerHolder(Protocol):
    """Holds the hammer at its release angle, and lets it go: one object for one device.

    All calls come from one thread. Whatever goes wrong with the device is a `DeviceError` as with
    an `AccelerationSource`; no call takes longer than half a second. A holder never lets go by
    itself: not when it is configured, not when it is closed, not after an error, as far as its
    device lets it choose.

    A driver is a class, found by the entry point group `impact_rig.hammer_holders` and called
    with the table `[holder]` of the rig file without the keys that all holders share.

    Attributes
    ----------
    description : str
        What the driver is for, in a few words.
    example : str
        Table `[holder]` of a rig file to copy, with the driver's own keys explained.
    is_by_hand : bool
        An operator lets the hammer go: `release` only says that he may. How long he may take
        from then to the contact is the holder's attribute `patience` [s].
    """

    description: ClassVar[str]
    example: ClassVar[str]
    is_by_hand: ClassVar[bool]

    def __init__(self, options: TomlTable) -> None: ...

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return what can be found without touching it; as `AccelerationSource.find_devices`."""
        ...

    def configure(self) -> str:
        """Open the device, and hold; return what it is, as far as it tells.

        Raises
        ------
        DeviceError
            If it is not there, held by another program, or does not obey.
        """
        ...

    def hold(self) -> None:
        """Hold, or go on holding."""
        ...

    def release(self) -> None:
        """Let go."""
        ...

    def read_state(self) -> HolderState:
        """Ask the device, where it can tell, else return what it was told last.

        Raises
        ------
        DeviceError
            If it is gone, or contradicts what it was told.
        """
        ...

    def close(self) -> None:
        """Let the device go as it is, holding or not; never raises, safe to call twice."""
        ...
