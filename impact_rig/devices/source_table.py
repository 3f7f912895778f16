"""The table [source] of a rig file: its device, and the acquisition plan for it."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from impact_rig.configuration.rig_file import PRE_TRIGGER_MARGIN, SENSOR_KEYS, take_trigger_level
from impact_rig.configuration.toml_table import TomlTable, make_values, parse_toml_table
from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.setup import RigSetup
from impact_rig.devices.drivers import COMMON_KEYS, SOURCES, VIRTUAL, make_device, read_driver_name
from impact_rig.devices.protocols import (
    AccelerationSource,
    AcquisitionPlan,
    HammerlessSource,
    SourceChannel,
)
from impact_rig.devices.speed_gate import take_channel_name, take_speed_gate
from impact_rig.devices.virtual.drivers import (
    KEYS,
    QUANTITIES,
    VirtualSource,
    make_virtual_plan,
    read_virtual_rig,
)
from impact_rig.devices.virtual.rig import VirtualRigSettings

RECORD_KEYS = ("sampling_rate", "record_duration", "pre_trigger")
"""Keys of [source] that say the same of every driver."""


def override_source(table: TomlTable, text: str) -> TomlTable:
    """Return a table [source] overruled by the keys of a text of TOML.

    Raises
    ------
    ParameterError
        If the text is no TOML, or describes a sensor.
    """
    try:
        given = parse_toml_table(text)
    except ParameterError as error:
        raise ParameterError(f"parameter source: {error}") from None
    for key, value in given.items():
        if isinstance(value, Mapping):
            raise ParameterError(
                f"parameter source has a table {key!r}: sensors are described in the rig file only"
            )
    if given and not table:
        table = TomlTable({"driver": VIRTUAL}, table.place)
    return table.merge(given)


def read_source_keys(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a program gives of a virtual rig, see `SourceKeys`, as keys of [source].

    Raises
    ------
    ParameterError
        If one is unknown, or cannot be meant.
    """
    units = {name: unit for name, (unit, _) in QUANTITIES.items()}
    named = {"fault_probability" if name == "faults" else name: given[name] for name in given}
    keys = make_values({key: value for key, value in named.items() if value is not None}, units)
    table = TomlTable(keys, "the virtual rig")
    table.check_keys(*KEYS)
    read_virtual_rig(table)
    return keys


def read_virtual_settings(
    table: TomlTable, setup: RigSetup, given: Mapping[str, Any]
) -> VirtualRigSettings:
    """Return what a virtual rig is by a table [source], as its node takes it.

    Parameters
    ----------
    table : TomlTable
        Of the rig file. Where it is of a device, a virtual rig has its rate and record alone.
    setup : RigSetup
        For the speed gate.
    given : mapping
        Keys that a program gives in place of the table's, see `read_source_keys`.

    Raises
    ------
    ParameterError
        If a value cannot be meant; the message names its line.
    """
    if read_driver_name(table) != VIRTUAL:
        table = table.without(*(key for key in table if key not in RECORD_KEYS))
    table = table.merge(TomlTable(given))
    source = VirtualSource(table.without(*COMMON_KEYS[SOURCES]))
    return source.choose_settings(_choose_plan(source, table, setup))


def make_source(
    table: TomlTable,
    setup: RigSetup,
    *,
    continuous: bool = False,
    block_size: int = AcquisitionPlan.block_size,
    depth: int = AcquisitionPlan.depth,
) -> tuple[AccelerationSource, AcquisitionPlan]:
    """Return the source of a table [source], not yet configured, and its plan.

    Parameters
    ----------
    table : TomlTable
        Of the rig file.
    setup : RigSetup
        Its sensors, the hammer's mass and the analysis's window are used.
    continuous : bool
        Without a trigger.
    block_size, depth : int
        As in `AcquisitionPlan`.

    Raises
    ------
    RigError
        If the table cannot be meant, or the driver cannot be loaded.
    """
    source: AccelerationSource = make_device(SOURCES, table)
    plan = _choose_plan(source, table, setup)
    return source, replace(plan, continuous=continuous, block_size=block_size, depth=depth)


def _choose_plan(source: AccelerationSource, table: TomlTable, setup: RigSetup) -> AcquisitionPlan:
    """Return the plan of a source by its table [source]."""
    # A source that no hammer strikes has no sensors that the table could describe.
    is_virtual = isinstance(source, HammerlessSource)
    plan = make_virtual_plan(table) if is_virtual else make_plan(table, setup)
    gate = take_speed_gate(table, setup)
    if gate is not None and not getattr(source, "measures_speed", False):
        raise table.make_error(
            "impact_speed",
            f"{gate.options.place} cannot be used: the driver {table.get('driver')!r} reads the"
            " two accelerometers only, and 'opendaq' and 'sound' a light barrier, too",
        )
    return replace(plan, gate=gate)


def make_plan(table: TomlTable, setup: RigSetup) -> AcquisitionPlan:
    """Return the plan of a triggered source from a table [source].

    Raises
    ------
    ParameterError
        If a value is missing or cannot be meant; the message names its line.
    """
    analysis = setup.analysis
    hammer = _make_channel(table, "hammer", setup)
    if hammer is None:
        raise table.make_error(
            "hammer",
            f"{table.place} has no [source.hammer]: add it, the hammer's pulse is measured",
        )
    pre_trigger = table.take_quantity(
        "pre_trigger", "s", "300 us", PRE_TRIGGER_MARGIN * analysis.pre_trigger, low=0.0
    )
    usual = pre_trigger + analysis.record_duration - analysis.pre_trigger
    duration = table.take_quantity("record_duration", "s", "2.2 ms", usual, low=0.0)
    rate = table.take_quantity("sampling_rate", "Hz", "2.5 MHz", low=1.0)
    level = _take_level(table, hammer, setup)
    specimen = _make_channel(table, "specimen", setup)
    with table.locating():
        return AcquisitionPlan(rate, duration, pre_trigger, level, hammer, specimen)


def _make_channel(table: TomlTable, name: str, setup: RigSetup) -> SourceChannel | None:
    sensors = [sensor for sensor in setup.sensors if sensor.channel == name]
    if name not in table or not sensors:
        return None
    channel = table.take_table(name)
    return SourceChannel(
        take_channel_name(channel),
        sensors[0],
        setup.hammer_mass if sensors[0].quantity == "force" else math.nan,
        channel.without("channel", *SENSOR_KEYS),
    )


def _take_level(table: TomlTable, hammer: SourceChannel, setup: RigSetup) -> float:
    """Return the acceleration that triggers [m/s^2]."""
    full_scale = hammer.sensor.compute_full_scale(hammer.moving_mass)
    level = take_trigger_level(table, hammer.moving_mass)
    if level is None and not full_scale:
        raise table.make_error(
            "trigger_level",
            f'{table.place} lacks trigger_level: give it, for example trigger_level = "5 g", or'
            " the hammer sensor's full_scale",
        )
    return setup.analysis.detection_level * full_scale if level is None else level
