"""The sensors in a rig file: tables [source.hammer] and [source.specimen]."""

import math

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.configuration.units import parse_reading, parse_sensitivity
from impact_rig.core.errors import ParameterError
from impact_rig.core.setup.calibration import find_scale, normalize_unit
from impact_rig.core.setup.sensors import CHANNELS, QUANTITIES, Sensor

SENSOR_KEYS = (
    "quantity",
    "sensitivity",
    "unit",
    "full_scale",
    "serial_number",
    "calibration_date",
)
"""What a calibration sheet says; the other keys of such a table are the driver's."""


def parse_sensors(source: TomlTable) -> tuple[Sensor, ...]:
    """Return the sensors of the channels that the table [source] has; raises `ParameterError`."""
    return tuple(
        _parse_sensor(channel, source.take_table(channel))
        for channel in CHANNELS
        if channel in source
    )


def _parse_sensor(channel: str, table: TomlTable) -> Sensor:
    quantity = table.take_choice("quantity", tuple(QUANTITIES), "acceleration")
    voltage, unit = math.nan, QUANTITIES[quantity][0]
    if "unit" in table:
        unit = _check_unit(table, "unit", table.take_text("unit"), quantity)
    if "sensitivity" in table:
        voltage, unit = _take_sensitivity(table, quantity)
    if quantity == "force" and channel != "hammer":
        raise table.refuse("quantity", "acceleration: on the sample nothing else is measured")
    return Sensor(
        channel=channel,
        quantity=quantity,
        unit=unit,
        sensitivity=voltage,
        full_scale=_take_full_scale(table, quantity, unit),
        serial_number=table.take_text("serial_number"),
        calibration_date=table.take_date("calibration_date"),
    )


def _take_sensitivity(table: TomlTable, quantity: str) -> tuple[float, str]:
    """Return the voltage of one unit [V], and the unit."""
    try:
        found = parse_sensitivity(f"sensitivity of {table.place}", table["sensitivity"])
    except ParameterError as error:
        raise table.make_error("sensitivity", str(error)) from None
    unit = _check_unit(table, "sensitivity", found.unit, quantity)
    if "unit" in table and normalize_unit(table["unit"]) != unit:
        raise table.refuse("unit", f"{unit}, as the sensitivity says")
    return found.voltage, unit


def _take_full_scale(table: TomlTable, quantity: str, unit: str) -> float:
    """Return the largest value that the sensor takes [unit]; 0: not stated."""
    if "full_scale" not in table:
        return 0.0
    try:
        value, stated = parse_reading(f"full_scale of {table.place}", table["full_scale"])
    except ParameterError as error:
        raise table.make_error("full_scale", str(error)) from None
    stated = _check_unit(table, "full_scale", stated, quantity)
    if not value > 0.0:
        raise table.refuse("full_scale", "above zero")
    # Of a force, the mass that it acts on cancels out.
    return value * find_scale(stated, 1.0) / find_scale(unit, 1.0)


def _check_unit(table: TomlTable, key: str, unit: str, quantity: str) -> str:
    name = normalize_unit(unit)
    if name not in QUANTITIES[quantity]:
        raise table.refuse(key, f"in {' or '.join(QUANTITIES[quantity])}: it is of a {quantity}")
    return name
