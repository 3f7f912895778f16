"""The virtual rig's holder: it holds and lets go at once, and never fails."""

from typing import ClassVar

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.devices.found_device import FoundDevice
from impact_rig.devices.hammer_holder import HolderState

IDENTITY = "virtual rig"


class VirtualHolder:
    """Holds the virtual rig's hammer.

    Parameters
    ----------
    options : TomlTable
        Has no keys.

    Raises
    ------
    ParameterError
        If it has any.
    """

    description: ClassVar[str] = "the virtual rig's holder"
    example: ClassVar[str] = '[holder]\ndriver = "virtual"\n'
    is_by_hand: ClassVar[bool] = False

    def __init__(self, options: TomlTable) -> None:
        options.check_keys()
        self._state = HolderState.HOLDING

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return nothing: there is no device."""
        return ()

    def configure(self) -> str:
        """Hold."""
        self.hold()
        return IDENTITY

    def hold(self) -> None:
        """Hold."""
        self._state = HolderState.HOLDING

    def release(self) -> None:
        """Let go."""
        self._state = HolderState.RELEASED

    def read_state(self) -> HolderState:
        """Return what it was told last."""
        return self._state

    def close(self) -> None:
        """Do nothing: there is nothing to let go of."""
