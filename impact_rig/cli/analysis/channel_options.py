"""Options that say which channel of measured files is what: of `analyze` and of `import`."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from impact_rig.cli.quantity import Quantity, Reading, SensitivityText
from impact_rig.core.setup.calibration import UNITS

_UNITS = ", ".join(UNITS)

OPTIONS = (
    click.option(
        "--channels",
        type=click.Path(path_type=Path),
        metavar="FILE.toml",
        help="File that holds all of the following; `import --template` prints one.",
    ),
    click.option(
        "--hammer",
        metavar="CHANNEL",
        help="Name or number of the hammer's channel. [the first one]",
    ),
    click.option(
        "--specimen",
        metavar="CHANNEL",
        help="Of the sample's. [the second one; none if --hammer is given]",
    ),
    click.option(
        "--columns",
        metavar="ROLE,...",
        help="Or the role of every column: time, hammer, specimen or skip.",
    ),
    click.option(
        "--rate",
        type=Quantity("Hz", "25.6 kHz"),
        metavar="RATE",
        help="For files that state neither times nor a sampling rate.",
    ),
    click.option(
        "--hammer-unit",
        metavar="UNIT",
        help=f"Of the hammer's channel: {_UNITS}. [as the file states it; else m/s^2]",
    ),
    click.option("--sample-unit", metavar="UNIT", help="Of the sample's channel, likewise."),
    click.option(
        "--hammer-sensitivity",
        type=SensitivityText(),
        metavar="VALUE",
        help='For a channel in V: "10 mV/g", of a force hammer "2.25 mV/N".',
    ),
    click.option(
        "--sample-sensitivity", type=SensitivityText(), metavar="VALUE", help="Likewise."
    ),
    click.option(
        "--hammer-full-scale",
        type=Reading(),
        metavar="VALUE",
        help='Largest value that the channel can show: "500 g", "10 V". [not known]',
    ),
    click.option("--sample-full-scale", type=Reading(), metavar="VALUE", help="Likewise."),
    click.option("--sample", metavar="NAME", help="Which sample was struck."),
    click.option(
        "--rig-file",
        "--setup",
        "rig_file",
        type=click.Path(path_type=Path),
        help="TOML file with masses and settings; --sample is one of its samples.",
    ),
    click.option("--hammer-mass", type=Quantity("kg", "100 g"), metavar="MASS", help="m1."),
    click.option(
        "--sample-mass",
        type=Quantity("kg", "102.38 g"),
        metavar="MASS",
        help="Without accelerometer.",
    ),
    click.option(
        "--accelerometer-mass",
        type=Quantity("kg", "3 g"),
        metavar="MASS",
        help="Carried by the sample. [0]",
    ),
    click.option(
        "--hammer-stiffness",
        type=Quantity("N/m", "22.5 MN/m"),
        metavar="K",
        help="k1, from an earlier control experiment.",
    ),
    click.option("--control", is_flag=True, help="Hammer and sample are alike: k1 = k2 = 2 k_eq."),
)
"""In the order of the help; their names are the fields of `TraceOptions`."""


def add_channel_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command all of `OPTIONS`."""
    for option in reversed(OPTIONS):
        command = option(command)
    return command
