"""The file of `--channels`: which channel of measured files is what, with units and masses."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from impact_rig.configuration.toml_tables import (
    check_keys,
    parse_settings,
    parse_toml,
    read_text_file,
    take_table,
    take_text,
)
from impact_rig.configuration.units import parse_quantity, parse_reading, parse_sensitivity
from impact_rig.core.errors import FileError, ParameterError, RigError
from impact_rig.core.setup.channel_plan import ChannelPlan, ChannelUse

CHANNEL_KEYS = ("channel", "unit", "sensitivity", "full_scale", "mass")
NAN = math.nan


@dataclass(frozen=True)
class ImportFile:
    """What such a file says; NaN, empty: nothing.

    Attributes
    ----------
    plan : ChannelPlan
        Which channel is what.
    sample, description : str
        Name of the struck sample, and the user's words.
    hammer_mass, sample_mass, accelerometer_mass : float
        [kg]
    hammer_stiffness : float
        k1 [N/m].
    control : bool
        Hammer and sample are alike.
    settings : mapping
        Fields of `AnalysisSettings` to replace, by name.
    """

    plan: ChannelPlan = field(default_factory=ChannelPlan)
    sample: str = ""
    description: str = ""
    hammer_mass: float = NAN
    sample_mass: float = NAN
    accelerometer_mass: float = NAN
    hammer_stiffness: float = NAN
    control: bool = False
    settings: Mapping[str, Any] = field(default_factory=dict)


def read_import_template() -> str:
    """Return such a file with comments: the one to copy and change."""
    return resources.files("impact_rig.configuration").joinpath("import.toml").read_text("utf-8")


def read_import_file(path: Path) -> ImportFile:
    """Read such a file.

    Raises
    ------
    FileError
        If there is none, it is no TOML, or something in it cannot be meant; the message names
        file, place and value.
    """
    text = read_text_file(path, "file of channels")
    try:
        return parse_import_file(text)
    except RigError as error:
        raise FileError(f"file of channels {path}: {error}") from None


def parse_import_file(text: str) -> ImportFile:
    """Read the text of such a file.

    Raises
    ------
    ParameterError
        If it is no TOML, has an unknown key, or a value cannot be meant.
    """
    document = parse_toml(text)
    check_keys(
        document,
        "the file",
        ("sample", "description", "columns", "sampling_rate", "hammer", "specimen", "analysis"),
    )
    hammer, specimen = take_table(document, "hammer"), take_table(document, "specimen")
    check_keys(hammer, "[hammer]", (*CHANNEL_KEYS, "stiffness"))
    check_keys(specimen, "[specimen]", (*CHANNEL_KEYS, "accelerometer_mass", "control"))
    return ImportFile(
        plan=ChannelPlan(
            hammer=_parse_use(hammer, "[hammer]"),
            specimen=_parse_use(specimen, "[specimen]"),
            columns=_parse_columns(document),
            sampling_rate=_parse(document, "the file", "sampling_rate", "Hz", "25.6 kHz"),
        ),
        sample=take_text(document, "the file", "sample"),
        description=take_text(document, "the file", "description"),
        hammer_mass=_parse(hammer, "[hammer]", "mass", "kg", "100 g"),
        sample_mass=_parse(specimen, "[specimen]", "mass", "kg", "102.38 g"),
        accelerometer_mass=_parse(specimen, "[specimen]", "accelerometer_mass", "kg", "3 g"),
        hammer_stiffness=_parse(hammer, "[hammer]", "stiffness", "N/m", "22.5 MN/m"),
        control=_parse_control(specimen),
        settings=parse_settings(document),
    )


def _parse(table: Mapping[str, Any], place: str, key: str, unit: str, example: str) -> float:
    if key not in table:
        return NAN
    return parse_quantity(f"{key} of {place}", table[key], unit, example)


def _parse_use(table: Mapping[str, Any], place: str) -> ChannelUse:
    full_scale, unit = (
        parse_reading(f"full_scale of {place}", table["full_scale"])
        if "full_scale" in table
        else (0.0, "m/s^2")
    )
    sensitivity = (
        parse_sensitivity(f"sensitivity of {place}", table["sensitivity"])
        if "sensitivity" in table
        else None
    )
    channel = table.get("channel", "")
    if isinstance(channel, bool) or not isinstance(channel, str | int):
        raise ParameterError(
            f"channel of {place} is {channel!r}: it must be a name in quotes or a whole number"
        )
    return ChannelUse(str(channel), take_text(table, place, "unit"), sensitivity, full_scale, unit)


def _parse_columns(document: Mapping[str, Any]) -> tuple[str, ...] | None:
    columns = document.get("columns")
    if columns is None:
        return None
    if not isinstance(columns, list) or not all(isinstance(role, str) for role in columns):
        raise ParameterError(f"columns is {columns!r}: it must be a list of roles in quotes")
    return tuple(columns)


def _parse_control(table: Mapping[str, Any]) -> bool:
    value = table.get("control", False)
    if not isinstance(value, bool):
        raise ParameterError(f"control of [specimen] is {value!r}: it must be true or false")
    return value
