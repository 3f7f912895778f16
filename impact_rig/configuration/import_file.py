"""The file of `--channels`: which channel of measured files is what, with units and masses."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from importlib import resources
from pathlib import Path
from typing import Any

from impact_rig.configuration.rig_file import parse_response, parse_settings
from impact_rig.configuration.toml_table import TomlTable, parse_toml_table, read_text_file
from impact_rig.configuration.units import parse_reading, parse_sensitivity
from impact_rig.core.errors import FileError, ParameterError, RigError
from impact_rig.core.setup.sensors import ChannelPlan, ChannelUse

CHANNEL_KEYS = (
    "channel",
    "unit",
    "sensitivity",
    "full_scale",
    "mass",
    "resonance",
    "resonance_damping",
    "low_corner",
)
RESPONSE_KEYS = {
    "resonance": "resonance",
    "resonance_damping": "damping",
    "low_corner": "low_corner",
}
"""Those of `SensorResponse`, and what they are there."""
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
        file, line, place and value.
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
    document = parse_toml_table(text)
    document.check_keys("sample", "description", "columns", "sampling_rate", "time_unit",
                        "hammer", "specimen", "analysis")  # fmt: skip
    hammer, specimen = document.take_table("hammer"), document.take_table("specimen")
    hammer.check_keys(*CHANNEL_KEYS, "stiffness")
    specimen.check_keys(*CHANNEL_KEYS, "accelerometer_mass", "control")
    return ImportFile(
        plan=_parse_plan(document, hammer, specimen),
        sample=document.take_text("sample"),
        description=document.take_text("description"),
        hammer_mass=hammer.take_quantity("mass", "kg", "100 g", NAN),
        sample_mass=specimen.take_quantity("mass", "kg", "102.38 g", NAN),
        accelerometer_mass=specimen.take_quantity("accelerometer_mass", "kg", "3 g", NAN),
        hammer_stiffness=hammer.take_quantity("stiffness", "N/m", "22.5 MN/m", NAN),
        control=specimen.take_boolean("control"),
        settings=parse_settings(document),
    )


def add_options(file: ImportFile, given: Mapping[str, Any]) -> ImportFile:
    """Return what a file says, changed by options of the command line, which go before it.

    Parameters
    ----------
    file : ImportFile
        What is changed.
    given : mapping
        Names or numbers of the channels `hammer` and `specimen`; `columns`, their roles between
        commas; `rate` [Hz]; `time_unit`; keys of a channel behind `hammer_` and `sample_`, of
        which `full_scale` has its unit beside it; and fields of `ImportFile` by their names.

    Raises
    ------
    ParameterError
        If they contradict each other, or a value cannot be meant.
    """
    plan = file.plan
    columns, hammer, specimen = plan.columns, plan.hammer, plan.specimen
    if "columns" in given:
        columns = tuple(role.strip() for role in given["columns"].split(","))
        hammer, specimen = replace(hammer, channel=""), replace(specimen, channel="")
    elif "hammer" in given:
        columns = None
    plan = ChannelPlan(
        _change_use(hammer, given, "hammer", "hammer"),
        _change_use(specimen, given, "sample", "specimen"),
        columns,
        given.get("rate", plan.sampling_rate),
        given.get("time_unit", plan.time_unit),
    )
    plain = {item.name for item in fields(ImportFile)} & given.keys()
    return replace(file, plan=plan, **{name: given[name] for name in plain})


def _change_use(use: ChannelUse, given: Mapping[str, Any], body: str, role: str) -> ChannelUse:
    found = {key: given.get(f"{body}_{key}") for key in CHANNEL_KEYS if key != "mass"}
    found |= {"channel": given.get(role)}
    values = {key: value for key, value in found.items() if value is not None}
    if "full_scale" in values:
        values["full_scale"], values["full_scale_unit"] = values["full_scale"]
    response = {key: values.pop(name) for name, key in RESPONSE_KEYS.items() if name in values}
    return replace(use, response=replace(use.response, **response), **values)


def _parse_plan(document: TomlTable, hammer: TomlTable, specimen: TomlTable) -> ChannelPlan:
    uses = {"hammer": _parse_use(hammer), "specimen": _parse_use(specimen)}
    columns = _parse_columns(document)
    sampling_rate = document.take_quantity("sampling_rate", "Hz", "25.6 kHz", NAN)
    try:
        unit = document.take_text("time_unit")
        return ChannelPlan(columns=columns, sampling_rate=sampling_rate, time_unit=unit, **uses)
    except ParameterError as error:
        raise document.locate(error) from None


def _parse_use(table: TomlTable) -> ChannelUse:
    channel = table.get("channel", "")
    if isinstance(channel, bool) or not isinstance(channel, str | int):
        raise table.refuse("channel", "a name in quotes or a whole number")
    unit = table.take_text("unit")
    full_scale, full_scale_unit = 0.0, "m/s^2"
    sensitivity = None
    try:
        if "full_scale" in table:
            full_scale, full_scale_unit = parse_reading(
                f"full_scale of {table.place}", table["full_scale"]
            )
        if "sensitivity" in table:
            sensitivity = parse_sensitivity(f"sensitivity of {table.place}", table["sensitivity"])
        return ChannelUse(
            str(channel), unit, sensitivity, full_scale, full_scale_unit, parse_response(table)
        )
    except ParameterError as error:
        raise table.locate(error) from None


def _parse_columns(document: TomlTable) -> tuple[str, ...] | None:
    columns = document.get("columns")
    if columns is None:
        return None
    if not isinstance(columns, list) or not all(isinstance(role, str) for role in columns):
        raise document.refuse("columns", "a list of roles in quotes")
    return tuple(columns)
