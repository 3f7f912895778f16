"""`impact-rig calibrate`: a sensor's sensitivity from hits, in a new rig file."""

from pathlib import Path

import click

from impact_rig.cli import options
from impact_rig.cli.quantity import Quantity
from impact_rig.core.errors import ParameterError
from impact_rig.core.setup.sensors import CHANNELS


@click.command(
    "calibrate",
    epilog="""
    \b
    Examples:
      impact-rig calibrate rig.toml --back-to-back --sensor specimen \\
          --reference-uncertainty "0.75 %"
      impact-rig calibrate rig.toml --known-mass 150.2g --mass-uncertainty 10mg
      impact-rig calibrate rig.toml --known-mass 150.2g --recording session.mcap

    \b
    Back to back: the sensor under test is mounted on the reference, on the other channel, and both
    see the same acceleration. Known mass: the hammer strikes a body that is free to move; force is
    mass times acceleration. Strike by hand, in the direction of the sensors.
    The new sensitivity and the day go into rig-DAY.toml beside rig.toml; all else is copied.
    """,
)
@click.argument("rig_file", type=click.Path(path_type=Path))
@click.option("--back-to-back", is_flag=True, help="Both sensors see the same acceleration.")
@click.option(
    "--known-mass",
    type=Quantity("kg", "150 g"),
    metavar="MASS",
    help="Of all that moves with the struck body, its sensor included.",
)
@click.option(
    "--sensor",
    "channel",
    type=click.Choice(CHANNELS),
    help="The one under test; the other is the reference. [with a known mass: hammer]",
)
@click.option(
    "--reference-uncertainty",
    type=Quantity("dimensionless", "0.75 %"),
    default=0.0,
    metavar="PART",
    help="Standard uncertainty of the reference's sensitivity: half of what its certificate"
    " says for k = 2. [not stated]",
)
@click.option(
    "--mass-uncertainty",
    type=Quantity("kg", "10 mg"),
    default=0.0,
    metavar="MASS",
    help="Standard uncertainty of the known mass. [not stated]",
)
@click.option(
    "--recording",
    type=click.Path(path_type=Path),
    help="Take the hits of a recording. [strike now, on the source of the rig file]",
)
@click.option(
    "--sample", default="", metavar="NAME", help="Of the recording, the hits on this sample. [all]"
)
@click.option(
    "--hits",
    type=click.IntRange(3),
    default=10,
    metavar="N",
    help="How many to strike; Ctrl-C ends before. [10]",
)
@click.option(
    "--output", type=click.Path(path_type=Path), help="The new rig file. [beside the old one]"
)
@options.json_option
def command(
    rig_file: Path,
    back_to_back: bool,
    known_mass: float | None,
    channel: str | None,
    reference_uncertainty: float,
    mass_uncertainty: float,
    recording: Path | None,
    sample: str,
    hits: int,
    output: Path | None,
    as_json: bool,
) -> None:
    """Find the sensitivity of a sensor, and write a new rig file with it.

    Each hit gives a ratio, by least squares over the contact; hits whose traces do not fit are
    left out and named. The uncertainty is that of the GUM.
    """
    from impact_rig.cli.calibration.calibrating import calibrate
    from impact_rig.core.calibration.sensitivity import CalibrationMethod

    if back_to_back == (known_mass is not None):
        raise ParameterError("choose one of --back-to-back and --known-mass MASS")
    if mass_uncertainty and known_mass is None:
        raise ParameterError("--mass-uncertainty is for --known-mass")
    if sample and recording is None:
        raise ParameterError("--sample is for --recording")
    if channel is None:
        if back_to_back:
            raise ParameterError("--back-to-back needs --sensor: the one under test")
        channel = CHANNELS[0]
    method = CalibrationMethod(channel, reference_uncertainty=reference_uncertainty)
    if known_mass is not None:
        method = CalibrationMethod(channel, known_mass, mass_uncertainty, reference_uncertainty)
    calibrate(
        rig_file,
        method,
        recording=recording,
        sample=sample,
        wanted=hits,
        output=output,
        as_json=as_json,
    )
