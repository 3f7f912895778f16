"""`impact-rig devices`: drivers, the devices that they find, and those that a rig file names."""

from pathlib import Path

import click

from impact_rig.cli import options
from impact_rig.core.errors import DeviceError, ParameterError
from impact_rig.results.results_file import format_json

EXIT_FAULT = 1
"""A device of the rig file is not there, or cannot do what it is asked."""


@click.command(
    "devices",
    epilog="""
    \b
    Examples:
      impact-rig devices                       all drivers, and what they find
      impact-rig devices scpi                  one driver, with a table to copy
      impact-rig devices --check my-rig.toml   try what a rig file names
      impact-rig devices --json

    \b
    Any package may bring drivers: it names their classes by the entry points
    impact_rig.acceleration_sources and impact_rig.hammer_holders.
    Exit code: 1 if a device of the rig file is not there or cannot do what it is asked.
    """,
)
@click.argument("name", required=False, metavar="[DRIVER]")
@click.option(
    "--check",
    "rig_file",
    type=click.Path(path_type=Path),
    metavar="RIG_FILE",
    help="Open source and holder of a rig file, and close them again. The hammer stays held.",
)
@options.continuous_option
@options.json_option
def command(name: str | None, rig_file: Path | None, continuous: bool, as_json: bool) -> None:
    """See which drivers there are, whether they can work, and which devices they find.

    A driver whose library is missing says how to get it. The search changes no setting of any
    device.
    """
    if rig_file is None:
        if continuous:
            raise ParameterError("--continuous is for --check: the search opens no device")
        _show_drivers(name or "", as_json=as_json)
        return
    if name is not None:
        raise ParameterError(f"--check takes a rig file alone: leave {name!r} out")
    _check(rig_file, continuous=continuous, as_json=as_json)


def _show_drivers(name: str, *, as_json: bool) -> None:
    from impact_rig.cli.drivers.driver_view import drivers_to_json, print_driver, print_drivers
    from impact_rig.cli.drivers.survey import survey_drivers
    from impact_rig.devices.drivers import HOLDERS, SOURCES, find_drivers
    from impact_rig.reporting.terminal.console import make_console

    known = [*find_drivers(SOURCES), *find_drivers(HOLDERS)]
    if name and name not in known:
        raise DeviceError(
            f"there is no driver {name!r}: installed are {', '.join(dict.fromkeys(known))}"
        )
    drivers = survey_drivers(name)
    console = make_console()
    if as_json:
        click.echo(format_json(drivers_to_json(drivers)), nl=False)
    elif name:
        for driver in drivers:
            print_driver(console, driver)
    else:
        print_drivers(console, drivers)


def _check(rig_file: Path, *, continuous: bool, as_json: bool) -> None:
    from impact_rig.cli.drivers.check_view import checks_to_json, print_checks
    from impact_rig.cli.drivers.rig_check import check_rig
    from impact_rig.configuration.calibration_warnings import find_rig_warnings
    from impact_rig.configuration.rig_file import read_rig_file
    from impact_rig.reporting.terminal.console import make_console

    rig = read_rig_file(rig_file)
    checks = check_rig(rig, rig_file, continuous=continuous)
    warnings = find_rig_warnings(rig.setup)
    if as_json:
        click.echo(format_json(checks_to_json(checks, warnings)), nl=False)
    else:
        print_checks(make_console(), checks, warnings)
    if any(check.trouble for check in checks):
        raise SystemExit(EXIT_FAULT)
