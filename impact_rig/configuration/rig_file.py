"""The rig file: a TOML file in which a laboratory describes its rig and its samples."""

import difflib
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from impact_rig.configuration.units import parse_quantity
from impact_rig.core.errors import FileError, ParameterError, RigError
from impact_rig.core.setup.samples import (
    DEFAULT_CLOCK_UNCERTAINTY,
    RigSetup,
    Sample,
    SampleSet,
)
from impact_rig.core.setup.settings import AnalysisSettings

ANALYSIS_QUANTITIES = {
    "cutoff_frequency": ("Hz", "50 kHz"),
    "pre_trigger": ("s", "200 us"),
    "record_duration": ("s", "2 ms"),
}
"""Settings that have a unit; the others are plain numbers."""
WHOLE_SETTINGS = ("overload_run", "keep_hits")
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
    """

    setup: RigSetup
    virtual: Mapping[str, Any] = field(default_factory=dict)


def read_template() -> str:
    """Return the paper's rig as a rig file: the one to copy and change."""
    return resources.files("impact_rig.configuration").joinpath("paper.toml").read_text("utf-8")


def read_rig_file(path: Path) -> RigFile:
    """Read a rig file.

    Raises
    ------
    FileError
        If there is no such file, it is no TOML, or something in it cannot be meant; the message
        names file, place and value.
    """
    try:
        text = path.read_text("utf-8")
    except FileNotFoundError:
        raise FileError(f"there is no rig file {path}: check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"the rig file {path} cannot be read: {error}") from None
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
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ParameterError(f"this is no TOML: {error}") from None
    _check_keys(document, "the file", ("name", "description", "hammer", "digitizer", "analysis",
                                       "samples", "sample", "virtual"))  # fmt: skip
    hammer = _take_table(document, "hammer")
    _check_keys(hammer, "[hammer]", ("mass", "mass_uncertainty", "impact_speed"))
    setup = RigSetup(
        samples=_parse_samples(document),
        hammer_mass=_parse_required(hammer, "[hammer]", "mass", "kg", "100 g"),
        impact_speed=_parse_required(hammer, "[hammer]", "impact_speed", "m/s", "8.19 cm/s"),
        analysis=_parse_analysis(document),
        name=_take_text(document, "the file", "name"),
        description=_take_text(document, "the file", "description"),
        hammer_mass_uncertainty=_parse_mass(hammer, "[hammer]", "mass_uncertainty", "0.29 g"),
        clock_uncertainty=_parse_clock_uncertainty(document),
    )
    return RigFile(setup=setup, virtual=_take_table(document, "virtual"))


def _parse_samples(document: Mapping[str, Any]) -> SampleSet:
    common = _take_table(document, "samples")
    _check_keys(
        common, "[samples]", ("control", "accelerometer_mass", "accelerometer_mass_uncertainty")
    )
    entries = document.get("sample", [])
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise ParameterError("samples are given as tables [[sample]], one for each")
    return SampleSet(
        samples=tuple(_parse_sample(entry, index) for index, entry in enumerate(entries, 1)),
        control_sample=_take_text(common, "[samples]", "control"),
        accelerometer_mass=_parse_mass(common, "[samples]", "accelerometer_mass", "3 g"),
        accelerometer_mass_uncertainty=_parse_mass(
            common, "[samples]", "accelerometer_mass_uncertainty", "0.29 g"
        ),
    )


def _parse_sample(entry: Mapping[str, Any], index: int) -> Sample:
    place = f"sample {entry.get('name', index)!r}"
    _check_keys(
        entry, place, ("name", "material", "mass", "mass_uncertainty", *REFERENCE_QUANTITIES)
    )
    references = {
        key: parse_quantity(f"{key} of {place}", entry[key], unit, example)
        for key, (unit, example) in REFERENCE_QUANTITIES.items()
        if key in entry
    }
    return Sample(
        name=_take_text(entry, place, "name"),
        mass=_parse_required(entry, place, "mass", "kg", "21.31 g"),
        mass_uncertainty=_parse_mass(entry, place, "mass_uncertainty", "0.003 g"),
        material=_take_text(entry, place, "material"),
        **references,
    )


def _parse_analysis(document: Mapping[str, Any]) -> AnalysisSettings:
    table = _take_table(document, "analysis")
    _check_keys(table, "[analysis]", AnalysisSettings.__dataclass_fields__)
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key in ANALYSIS_QUANTITIES:
            unit, example = ANALYSIS_QUANTITIES[key]
            values[key] = parse_quantity(f"{key} in [analysis]", value, unit, example)
        elif isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ParameterError(f"{key} in [analysis] is {value!r}: it must be a plain number")
        elif key not in WHOLE_SETTINGS:
            values[key] = float(value)
        elif not isinstance(value, int):
            raise ParameterError(f"{key} in [analysis] is {value!r}: it must be whole")
        else:
            values[key] = value
    return AnalysisSettings(**values)


def _parse_clock_uncertainty(document: Mapping[str, Any]) -> float:
    table = _take_table(document, "digitizer")
    _check_keys(table, "[digitizer]", ("clock_uncertainty",))
    value = table.get("clock_uncertainty", DEFAULT_CLOCK_UNCERTAINTY)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ParameterError(
            f"clock_uncertainty in [digitizer] is {value!r}: it must be a plain number, a part of"
            " the sampling rate like 58e-6"
        )
    return float(value)


def _parse_mass(table: Mapping[str, Any], place: str, key: str, example: str) -> float:
    """Return an optional mass or its uncertainty [kg]; 0: not stated."""
    if key not in table:
        return 0.0
    return parse_quantity(f"{key} of {place}", table[key], "kg", example)


def _parse_required(
    table: Mapping[str, Any], place: str, key: str, unit: str, example: str
) -> float:
    if key not in table:
        raise ParameterError(f'{place} lacks {key}: give it, for example {key} = "{example}"')
    return parse_quantity(f"{key} of {place}", table[key], unit, example)


def _take_table(document: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    table = document.get(key, {})
    if not isinstance(table, dict):
        raise ParameterError(f"{key} is {table!r}: it must be a table [{key}]")
    return table


def _take_text(table: Mapping[str, Any], place: str, key: str) -> str:
    value = table.get(key, "")
    if not isinstance(value, str):
        raise ParameterError(f"{key} of {place} is {value!r}: it must be a text in quotes")
    return value


def _check_keys(table: Mapping[str, Any], place: str, known: Iterable[str]) -> None:
    names = list(known)
    for key in table:
        if key not in names:
            near = difflib.get_close_matches(key, names, n=1)
            hint = f"did you mean {near[0]!r}?" if near else "it knows " + ", ".join(names)
            raise ParameterError(f"{place} has an unknown key {key!r}: {hint}")
