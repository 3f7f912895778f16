"""An operator who lets the hammer go: the driver `manual`."""

from typing import ClassVar

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.devices.protocols import ToldHolder

PATIENCE = 60.0
"""How long an operator may take to let go, where the rig file does not say it [s], our choice."""
LONGEST_PATIENCE = 3600.0
"""The longest that makes sense [s], our choice."""
IDENTITY = "operator"


class ManualHolder(ToldHolder):
    """Tells an operator that he may let go, and believes that he does.

    Parameters
    ----------
    options : TomlTable
        `patience`.

    Attributes
    ----------
    patience : float
        How long he may take, from the release to the contact [s].

    Raises
    ------
    ParameterError
        If a key is unknown or its value cannot be meant.
    """

    description: ClassVar[str] = "an operator holds the hammer and lets it go"
    example: ClassVar[str] = (
        '[holder]\ndriver = "manual"\npatience = "60 s"  # how long he may take to let go\n'
    )
    is_by_hand: ClassVar[bool] = True

    def __init__(self, options: TomlTable) -> None:
        options.check_keys("patience")
        self.patience = options.take_quantity(
            "patience", "s", "60 s", PATIENCE, low=1.0, high=LONGEST_PATIENCE
        )

    def configure(self) -> str:
        """Take it that he holds the hammer."""
        self.hold()
        return IDENTITY
