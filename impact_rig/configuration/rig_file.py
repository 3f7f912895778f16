"""The rig file: a TOML file in which a laboratory describes its rig and its samples."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from impact_rig.configuration.toml_tables import (
    check_keys,
    parse_mass,
    parse_required,
    parse_settings,
    parse_toml,
    read_text_file,
    take_table,
    take_text,
)
from impact_rig.configuration.units import parse_quantity
from impact_rig.core.errors import FileError, ParameterError, RigError
from impact_rig.core.setup.samples import (
    DEFAULT_CLOCK_UNCERTAINTY,
    RigSetup,
    Sample,
    SampleSet,
)
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
    document = parse_toml(text)
    check_keys(document, "the file", ("name", "description", "hammer", "digitizer", "analysis",
                                       "samples", "sample", "virtual"))  # fmt: skip
    hammer = take_table(document, "hammer")
    check_keys(hammer, "[hammer]", ("mass", "mass_uncertainty", "impact_speed"))
    setup = RigSetup(
        samples=_parse_samples(document),
        hammer_mass=parse_required(hammer, "[hammer]", "mass", "kg", "100 g"),
        impact_speed=parse_required(hammer, "[hammer]", "impact_speed", "m/s", "8.19 cm/s"),
        analysis=AnalysisSettings(**parse_settings(document)),
        name=take_text(document, "the file", "name"),
        description=take_text(document, "the file", "description"),
        hammer_mass_uncertainty=parse_mass(hammer, "[hammer]", "mass_uncertainty", "0.29 g"),
        clock_uncertainty=_parse_clock_uncertainty(document),
    )
    return RigFile(setup=setup, virtual=take_table(document, "virtual"))


def _parse_samples(document: Mapping[str, Any]) -> SampleSet:
    common = take_table(document, "samples")
    check_keys(
        common, "[samples]", ("control", "accelerometer_mass", "accelerometer_mass_uncertainty")
    )
    entries = document.get("sample", [])
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise ParameterError("samples are given as tables [[sample]], one for each")
    return SampleSet(
        samples=tuple(_parse_sample(entry, index) for index, entry in enumerate(entries, 1)),
        control_sample=take_text(common, "[samples]", "control"),
        accelerometer_mass=parse_mass(common, "[samples]", "accelerometer_mass", "3 g"),
        accelerometer_mass_uncertainty=parse_mass(
            common, "[samples]", "accelerometer_mass_uncertainty", "0.29 g"
        ),
    )


def _parse_sample(entry: Mapping[str, Any], index: int) -> Sample:
    place = f"sample {entry.get('name', index)!r}"
    check_keys(
        entry, place, ("name", "material", "mass", "mass_uncertainty", *REFERENCE_QUANTITIES)
    )
    references = {
        key: parse_quantity(f"{key} of {place}", entry[key], unit, example)
        for key, (unit, example) in REFERENCE_QUANTITIES.items()
        if key in entry
    }
    return Sample(
        name=take_text(entry, place, "name"),
        mass=parse_required(entry, place, "mass", "kg", "21.31 g"),
        mass_uncertainty=parse_mass(entry, place, "mass_uncertainty", "0.003 g"),
        material=take_text(entry, place, "material"),
        **references,
    )


def _parse_clock_uncertainty(document: Mapping[str, Any]) -> float:
    table = take_table(document, "digitizer")
    check_keys(table, "[digitizer]", ("clock_uncertainty",))
    value = table.get("clock_uncertainty", DEFAULT_CLOCK_UNCERTAINTY)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ParameterError(
            f"clock_uncertainty in [digitizer] is {value!r}: it must be a plain number, a part of"
            " the sampling rate like 58e-6"
        )
    return float(value)
