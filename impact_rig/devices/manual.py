"""An operator who holds and releases the hammer: the driver `manual`."""

from typing import ClassVar

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.devices.protocols import CommandedHolder

IDENTITY = "operator"


class ManualHolder(CommandedHolder):
    """An operator releases the hammer on the rig's request.

    Raises
    ------
    ParameterError
        If a key is unknown or its value cannot be meant.
    """

    description: ClassVar[str] = "an operator holds and releases the hammer"
    example: ClassVar[str] = (
        '[holder]\ndriver = "manual"\npatience = "60 s"  # from the word to the contact\n'
    )
    is_by_hand: ClassVar[bool] = True

    def __init__(self, options: TomlTable) -> None:
        options.check_keys("patience")
        self.patience = options.take_quantity("patience", "s", "60 s", 60.0, low=1.0, high=3600.0)

    def configure(self) -> str:
        """Assume that the operator holds the hammer."""
        self.hold()
        return IDENTITY
