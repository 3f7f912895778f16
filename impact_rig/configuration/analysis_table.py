"""The table [analysis] of a rig file or a file of channels."""

from typing import Any

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.setup.settings import AnalysisSettings

ANALYSIS_QUANTITIES = {
    "cutoff_frequency": ("Hz", "50 kHz"),
    "pre_trigger": ("s", "200 us"),
    "record_duration": ("s", "2 ms"),
}
"""Settings that have a unit; the others are plain numbers."""
WHOLE_SETTINGS = ("overload_run", "keep_hits")


def parse_settings(document: TomlTable) -> dict[str, Any]:
    """Return the settings that the table [analysis] gives, in SI units, by their names.

    Parameters
    ----------
    document : TomlTable
        The whole file.

    Raises
    ------
    ParameterError
        If one is unknown, or is no number.
    """
    table = document.take_table("analysis")
    table.check_keys(*AnalysisSettings.__dataclass_fields__)
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key in ANALYSIS_QUANTITIES:
            values[key] = table.take_quantity(key, *ANALYSIS_QUANTITIES[key])
        elif isinstance(value, bool) or not isinstance(value, int | float):
            raise table.refuse(key, "a plain number")
        elif key not in WHOLE_SETTINGS:
            values[key] = float(value)
        elif not isinstance(value, int):
            raise table.refuse(key, "whole")
        else:
            values[key] = value
    return values
