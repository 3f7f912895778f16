"""The rig file: a TOML file in which a laboratory describes its rig and its samples."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from impact_rig.configuration.analysis_table import parse_settings
from impact_rig.configuration.sensor_table import parse_sensors
from impact_rig.configuration.text_file import read_text_file
from impact_rig.configuration.toml_table import TomlTable, parse_toml_table
from impact_rig.core.errors import FileError, ParameterError, RigError
from impact_rig.core.setup.samples import (
    DEFAULT_CLOCK_UNCERTAINTY,
    RigSetup,
    Sample,
    SampleSet,
)
from impact_rig.core.setup.sensors import Sensor
from impact_rig.core.setup.settings import AnalysisSettings

REFERENCE_QUANTITIES = {
    "reference_contact_time": ("s", "203.2 us"),
    "reference_stiffness": ("N/m", "45.29 MN/m"),
    "reference_damping_coefficient": ("N*s/m", "1170 N*s/m"),
}


@dataclass(frozen=True)
class RigFile:
    """What a rig file says.

    Attributes
    ----------
    setup : RigSetup
        Masses, samples, settings.
    virtual : mapping
        Parameters of the virtual rig, by the names of the accelerometer node's parameters; empty
        where the file has no such table.
    hammer : mapping
        Parameters of the hammer node, by its names: what [holder] says of the swing.
    source, holder : TomlTable
        What delivers accelerations and what holds the hammer, as their drivers understand it;
        empty where the file has no such table: the virtual rig.
    """

    setup: RigSetup
    virtual: Mapping[str, Any] = field(default_factory=dict)
    hammer: Mapping[str, Any] = field(default_factory=dict)
    source: TomlTable = field(default_factory=lambda: TomlTable({}, "[source]"))
    holder: TomlTable = field(default_factory=lambda: TomlTable({}, "[holder]"))


def read_template() -> str:
    """Return the paper's rig as a rig file: the one to copy and change."""
    return resources.files("impact_rig.configuration").joinpath("paper.toml").read_text("utf-8")


def read_rig_file(path: Path) -> RigFile:
    """Read a rig file.

    Raises
    ------
    FileError
        If there is no such file, it is no TOML, or something in it cannot be meant; the message
        names file, line, place and value.
    """
    text = read_text_file(path, "rig file")
    try:
        return parse_rig_file(text)
    except RigError as error:
        raise FileError(f"rig file {path}: {error}") from None


def parse_rig_file(text: str) -> RigFile:
    """Read the text of a rig file.

    Raises
    ------
    ParameterError
        If it is no TOML, has an unknown key, lacks one, or a value cannot be meant.
    """
    document = parse_toml_table(text)
    document.check_keys("name", "description", "hammer", "digitizer", "analysis", "samples",
                        "sample", "virtual", "source", "holder")  # fmt: skip
    source, holder = document.take_table("source"), document.take_table("holder")
    return RigFile(
        setup=_parse_setup(document, parse_sensors(source)),
        virtual=document.take_table("virtual"),
        hammer=_parse_swing(holder),
        source=source,
        holder=holder,
    )


def _parse_setup(document: TomlTable, sensors: tuple[Sensor, ...]) -> RigSetup:
    hammer = document.take_table("hammer")
    hammer.check_keys("mass", "mass_uncertainty", "impact_speed")
    samples = _parse_samples(document)
    analysis = _parse_analysis(document)
    clock_uncertainty = _parse_clock_uncertainty(document)
    masses = {
        "hammer_mass": hammer.take_quantity("mass", "kg", "100 g"),
        "impact_speed": hammer.take_quantity("impact_speed", "m/s", "8.19 cm/s"),
        "hammer_mass_uncertainty": hammer.take_quantity("mass_uncertainty", "kg", "0.29 g", 0.0),
    }
    name, description = document.take_text("name"), document.take_text("description")
    try:
        return RigSetup(
            samples=samples,
            analysis=analysis,
            name=name,
            description=description,
            clock_uncertainty=clock_uncertainty,
            sensors=sensors,
            **masses,
        )
    except ParameterError as error:
        raise hammer.locate(error) from None


def _parse_analysis(document: TomlTable) -> AnalysisSettings:
    settings = parse_settings(document)
    try:
        return AnalysisSettings(**settings)
    except ParameterError as error:
        raise document.take_table("analysis").locate(error) from None


def _parse_swing(holder: TomlTable) -> dict[str, Any]:
    """Return the hammer's parameters that a table [holder] gives."""
    parameters: dict[str, Any] = {
        key: holder.take_quantity(key, "s", "207 ms", low=0.0, high=60.0)
        for key in ("swing_time", "return_time")
        if key in holder
    }
    if "confirm_return" in holder:
        parameters["confirm_return"] = holder.take_boolean("confirm_return", default=False)
    return parameters


def _parse_samples(document: TomlTable) -> SampleSet:
    common = document.take_table("samples")
    common.check_keys("control", "accelerometer_mass", "accelerometer_mass_uncertainty")
    samples: dict[str, Sample] = {}
    for table in document.take_tables("sample"):
        sample = _parse_sample(table)
        if sample.name in samples:
            raise table.make_error("name", f"{table.place} appears twice: names are unique")
        samples[sample.name] = sample
    control = common.take_text("control")
    masses = {
        "accelerometer_mass": common.take_quantity("accelerometer_mass", "kg", "3 g", 0.0),
        "accelerometer_mass_uncertainty": common.take_quantity(
            "accelerometer_mass_uncertainty", "kg", "0.29 g", 0.0
        ),
    }
    try:
        return SampleSet(tuple(samples.values()), control, **masses)
    except ParameterError as error:
        raise common.locate(error) from None


def _parse_sample(table: TomlTable) -> Sample:
    table.check_keys("name", "material", "mass", "mass_uncertainty", *REFERENCE_QUANTITIES)
    name, material = table.take_text("name"), table.take_text("material")
    numbers = {
        "mass": table.take_quantity("mass", "kg", "21.31 g"),
        "mass_uncertainty": table.take_quantity("mass_uncertainty", "kg", "0.003 g", 0.0),
        **{
            key: table.take_quantity(key, unit, example)
            for key, (unit, example) in REFERENCE_QUANTITIES.items()
            if key in table
        },
    }
    try:
        return Sample(name=name, material=material, **numbers)
    except ParameterError as error:
        raise table.locate(error) from None


def _parse_clock_uncertainty(document: TomlTable) -> float:
    table = document.take_table("digitizer")
    table.check_keys("clock_uncertainty")
    value = table.get("clock_uncertainty", DEFAULT_CLOCK_UNCERTAINTY)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value < 1.0:
        raise table.refuse(
            "clock_uncertainty", "a plain number, a part of the sampling rate like 58e-6"
        )
    return float(value)
