"""Drivers of devices, this package's and others', found by their entry points."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata, resources
from typing import Any

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.core.given.errors import DeviceError

SOURCES = "impact_rig.acceleration_sources"
HOLDERS = "impact_rig.hammer_holders"
"""Entry point groups: a package that names a class there adds a driver."""
VIRTUAL = "virtual"
"""Driver where the rig file has no such table."""
COMMON_KEYS = {
    SOURCES: (
        "driver", "sampling_rate", "record_duration", "pre_trigger", "trigger_level", "hammer",
        "specimen", "impact_speed",
    ),
    HOLDERS: ("driver", "swing_time", "return_time", "confirm_return"),
}  # fmt: skip
"""Keys of the tables [source] and [holder] for all drivers; the others are the driver's."""


@dataclass(frozen=True)
class Driver:
    """A driver that is installed; its module is imported when it is loaded, not before."""

    name: str  # as the rig file names it
    package: str  # the distribution that brings it
    entry_point: metadata.EntryPoint

    def load(self) -> Any:
        """Return the driver's class.

        Raises
        ------
        DeviceError
            If the package names a class that is not there, or that fails to import.
        """
        try:
            return self.entry_point.load()
        except (ImportError, AttributeError) as error:
            raise DeviceError(
                f"driver {self.name!r} of {self.package} cannot be loaded: {error}"
            ) from None


def read_example(name: str) -> str:
    """Return a driver's table of a rig file to copy, of the folder `examples`."""
    return resources.files(__package__).joinpath("examples", f"{name}.toml").read_text("utf-8")


def find_drivers(group: str) -> Mapping[str, Driver]:
    """Return all drivers of a group by name.

    Parameters
    ----------
    group : str
        `SOURCES` or `HOLDERS`.
    """
    drivers = {}
    for entry_point in metadata.entry_points(group=group):
        package = entry_point.dist.name if entry_point.dist is not None else "an unknown package"
        drivers[entry_point.name] = Driver(entry_point.name, package, entry_point)
    return dict(sorted(drivers.items()))


def read_driver_name(table: TomlTable) -> str:
    """Return which driver a table [source] or [holder] names; raises `ParameterError`."""
    return table.take_text("driver", REQUIRED if table else VIRTUAL, VIRTUAL)


def make_device(group: str, table: TomlTable) -> Any:
    """Return the source or holder that a table of a rig file describes, not yet configured.

    Parameters
    ----------
    group : str
        `SOURCES` or `HOLDERS`.
    table : TomlTable
        [source] or [holder] of the rig file.

    Raises
    ------
    ParameterError
        If there is no such driver, or it does not know a key or a value; names the line.
    DeviceError
        If the driver cannot be loaded.
    """
    name = read_driver_name(table)
    drivers = find_drivers(group)
    if name not in drivers:
        raise table.refuse("driver", f"one of {', '.join(drivers)}")
    return drivers[name].load()(table.without(*COMMON_KEYS[group]))
