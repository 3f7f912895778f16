"""The file of `--channels`: the channels of measured files, their units, and the masses."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from importlib import resources
from pathlib import Path
from typing import Any

from impact_rig.configuration.rig_file import RESPONSE_KEYS, parse_response, parse_settings
from impact_rig.configuration.toml_table import TomlTable, parse_toml_table, read_toml_file
from impact_rig.configuration.units import parse_reading, parse_sensitivity, read_given
from impact_rig.core.given.errors import FileError, ParameterError, check_count, check_name
from impact_rig.core.given.quantity import Comparable
from impact_rig.files.plan import ChannelPlan, ChannelUse

CHANNEL_KEYS = (
    "channel", "unit", "sensitivity", "full_scale", "mass", "mass_uncertainty", *RESPONSE_KEYS,
)  # fmt: skip
PRE_TRIGGER_PART = 0.1  # of a record, before its hit; as 0.2 ms of 2 ms
NAN = math.nan


@dataclass(frozen=True)
class ImportFile(Comparable):
    """The content of a file of channels; NaN or empty: not stated."""

    plan: ChannelPlan = field(default_factory=ChannelPlan)
    sample: str = ""  # name of the struck sample
    description: str = ""
    hammer_mass: float = NAN  # [kg]
    sample_mass: float = NAN  # [kg]
    accelerometer_mass: float = NAN  # [kg]
    # Of these masses, standard [kg]; 0: not stated
    hammer_mass_uncertainty: float = 0.0
    sample_mass_uncertainty: float = 0.0
    accelerometer_mass_uncertainty: float = 0.0
    hammer_stiffness: float = NAN  # k1 [N/m]
    control: bool = False  # hammer and sample are alike
    settings: Mapping[str, float] = field(default_factory=dict)  # of `AnalysisSettings`, by name


@dataclass(frozen=True)
class MeasurementOptions:
    """Options of the command line for measured files; None: not given."""

    channels: Path | None = None  # a file of channels
    hammer_channel: str | None = None
    sample_channel: str | None = None
    hammer_unit: str | None = None
    rate: float | None = None  # [Hz]
    hammer_mass: float | None = None  # [kg]
    sample_mass: float | None = None  # [kg], without accelerometer
    rig_file: Path | None = None  # with masses and settings
    sample: str | None = None
    cutoff: float | None = None  # [Hz]
    record_duration: float | None = None  # [s]

    @property
    def given(self) -> tuple[str, ...]:
        """The names of those that were given."""
        return tuple(item.name for item in fields(self) if getattr(self, item.name) is not None)


QUANTITIES = {
    "rate": ("Hz", "25.6 kHz"),
    "hammer_mass": ("kg", "100 g"),
    "sample_mass": ("kg", "56.32 g"),
    "cutoff": ("Hz", "50 kHz"),
    "record_duration": ("s", "20 ms"),
}
"""Options with a unit, and an example each."""


def read_options(given: Mapping[str, Any]) -> MeasurementOptions:
    """Return the options that a program gives; raises `ParameterError` for one that is none."""
    values = dict(given)
    for name, value in given.items():
        check_name("option", name, [item.name for item in fields(MeasurementOptions)])
        if name in QUANTITIES:
            values[name] = read_given(name, value, *QUANTITIES[name])
        elif value is None:
            continue
        elif name in ("channels", "rig_file"):
            values[name] = Path(value)
        elif not isinstance(value, str) and name.endswith("_channel"):
            check_count(name, value, 1)
            values[name] = str(value)
        elif not isinstance(value, str):
            raise ParameterError(f"{name} is {value!r}: it must be a text")
    return MeasurementOptions(**values)


def read_import_template() -> str:
    """Return the template of a file of channels, with comments."""
    return resources.files("impact_rig.files").joinpath("import.toml").read_text("utf-8")


def read_import_file(path: Path) -> ImportFile:
    """Read a file of channels.

    Raises
    ------
    FileError
        If it does not exist, is not TOML, or has a wrong value; the message names file, line,
        place and value.
    """
    return read_toml_file(path, "file of channels", parse_import_file)


def read_analysis_settings(path: Path) -> dict[str, float]:
    """Read a file of channels for a recording, which takes only the table [analysis] from it.

    Returns
    -------
    dict
        Fields of `AnalysisSettings` to replace, by name.

    Raises
    ------
    FileError
        As `read_import_file`; or if the file holds anything else.
    """

    def parse(text: str) -> dict[str, float]:
        document = parse_toml_table(text)
        document.check_keys("analysis")
        return parse_settings(document)

    try:
        return read_toml_file(path, "file of channels", parse)
    except FileError as error:
        raise FileError(f"{error} (a recording takes only [analysis] from it)") from None


def parse_import_file(text: str) -> ImportFile:
    """Read the text of a file of channels.

    Raises
    ------
    ParameterError
        If it is not TOML, or has an unknown key or a wrong value.
    """
    document = parse_toml_table(text)
    document.check_keys("sample", "description", "columns", "sampling_rate", "time_unit",
                        "hammer", "specimen", "analysis")  # fmt: skip
    hammer, specimen = document.take_table("hammer"), document.take_table("specimen")
    hammer.check_keys(*CHANNEL_KEYS, "stiffness")
    specimen.check_keys(*CHANNEL_KEYS, "accelerometer_mass", "accelerometer_mass_uncertainty",
                        "control")  # fmt: skip
    return ImportFile(
        plan=_parse_plan(document, hammer, specimen),
        sample=document.take_text("sample"),
        description=document.take_text("description"),
        hammer_mass=hammer.take_quantity("mass", "kg", "100 g", NAN),
        sample_mass=specimen.take_quantity("mass", "kg", "102.38 g", NAN),
        accelerometer_mass=specimen.take_quantity("accelerometer_mass", "kg", "3 g", NAN),
        hammer_mass_uncertainty=_take_standard(hammer, "mass"),
        sample_mass_uncertainty=_take_standard(specimen, "mass"),
        accelerometer_mass_uncertainty=_take_standard(specimen, "accelerometer_mass"),
        hammer_stiffness=hammer.take_quantity("stiffness", "N/m", "22.5 MN/m", NAN),
        control=specimen.take_boolean("control"),
        settings=parse_settings(document),
    )


def _take_standard(table: TomlTable, mass: str) -> float:
    """Return the standard uncertainty of a mass [kg]; 0: not stated."""
    return table.take_quantity(f"{mass}_uncertainty", "kg", "0.1 g", 0.0, low=0.0)


def add_options(file: ImportFile, options: MeasurementOptions) -> ImportFile:
    """Return a file of channels with the command line's options in place of its own.

    Raises
    ------
    ParameterError
        If a value is wrong.
    """
    given = {name: getattr(options, name) for name in options.given}

    def choose(**names: str) -> dict[str, Any]:
        """Return the fields for which an option of this name is given."""
        return {key: given[name] for key, name in names.items() if name in given}

    plan = file.plan
    hammer = replace(plan.hammer, **choose(unit="hammer_unit", channel="hammer_channel"))
    specimen = replace(plan.specimen, **choose(channel="sample_channel"))
    settings = {**file.settings, **choose(cutoff_frequency="cutoff")}
    if options.record_duration is not None:
        settings["record_duration"] = options.record_duration
        settings.setdefault("pre_trigger", PRE_TRIGGER_PART * options.record_duration)
    return replace(
        file,
        plan=replace(plan, hammer=hammer, specimen=specimen, **choose(sampling_rate="rate")),
        settings=settings,
        **choose(sample="sample", hammer_mass="hammer_mass", sample_mass="sample_mass"),
    )


def _parse_plan(document: TomlTable, hammer: TomlTable, specimen: TomlTable) -> ChannelPlan:
    uses = {"hammer": _parse_use(hammer), "specimen": _parse_use(specimen)}
    columns = document.get("columns")
    if columns is not None:
        if not isinstance(columns, list) or not all(isinstance(role, str) for role in columns):
            raise document.refuse("columns", "a list of roles in quotes")
        columns = tuple(columns)
    sampling_rate = document.take_quantity("sampling_rate", "Hz", "25.6 kHz", NAN)
    unit = document.take_text("time_unit")
    with document.locating():
        return ChannelPlan(columns=columns, sampling_rate=sampling_rate, time_unit=unit, **uses)


def _parse_use(table: TomlTable) -> ChannelUse:
    channel = table.get("channel", "")
    if isinstance(channel, bool) or not isinstance(channel, str | int):
        raise table.refuse("channel", "a name in quotes or a whole number")
    use = ChannelUse(str(channel), table.take_text("unit"), stated=parse_response(table))
    with table.locating():
        if "full_scale" in table:
            of = parse_reading(f"full_scale of {table.place}", table["full_scale"])
            use = replace(use, full_scale=of[0], full_scale_unit=of[1])
        if "sensitivity" in table:
            found = parse_sensitivity(f"sensitivity of {table.place}", table["sensitivity"])
            use = replace(use, sensitivity=found)
        return use
