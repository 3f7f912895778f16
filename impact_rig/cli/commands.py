"""The commands that need no running rig: their options and help, light to load.

What a command does stands in the module of its name, which is loaded when it runs.
"""

from pathlib import Path
from typing import Any

import click

from impact_rig.cli import options
from impact_rig.cli.options import Parsed, make_quantity
from impact_rig.cli.start import load_module
from impact_rig.core.errors import ParameterError
from impact_rig.core.sensors import CHANNELS

FASTEST = 1000.0
SIMULATORS = ("mujoco", "sdf")
PARTS = ("hits", "means", "results")
"""What can be exported."""


def parse_parts(name: str, text: str) -> frozenset[str]:
    """Return names of `PARTS`, separated by commas; raises `ParameterError`."""
    parts = frozenset(part.strip() for part in text.split(","))
    for part in parts - {*PARTS}:
        raise ParameterError(f"{name}: {part!r} is not one of {', '.join(PARTS)}")
    return parts


@click.command(
    "devices",
    epilog="""
    \b
    Examples:
      impact-rig devices                       all drivers, and what they find
      impact-rig devices scpi                  one driver, with a table to copy
      impact-rig devices --check my-rig.toml   try what a rig file names
      impact-rig devices --json

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
@options.json_option
def devices(**values: Any) -> None:
    """See which drivers there are, whether they can work, and which devices they find.

    A driver whose library is missing says how to get it. The search changes no setting of any
    device.
    """
    load_module("impact_rig.cli.devices").run(**values)


@click.command(
    "calibrate",
    epilog="""
    \b
    Examples:
      impact-rig calibrate rig.toml --back-to-back --sensor specimen \\
          --reference-uncertainty "0.75 %"
      impact-rig calibrate rig.toml --known-mass 150.2g --mass-uncertainty 10mg
      impact-rig calibrate rig.toml --known-mass 150.2g --recording session.mcap

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
    type=make_quantity("kg", "150 g"),
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
    type=make_quantity("dimensionless", "0.75 %"),
    default=0.0,
    metavar="PART",
    help="Standard uncertainty of the reference's sensitivity: half of what its certificate"
    " says for k = 2. [not stated]",
)
@click.option(
    "--mass-uncertainty",
    type=make_quantity("kg", "10 mg"),
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
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="New rig file. [beside the old one]",
)
@options.json_option
def calibrate(**values: Any) -> None:
    """Find the sensitivity of a sensor, and write a new rig file with it.

    Each hit gives a ratio, by least squares over the contact; hits whose traces do not fit are
    left out and named. The uncertainty is that of the GUM.
    """
    load_module("impact_rig.cli.calibrate").run(**values)


@click.command(
    "analyze",
    epilog="""
    \b
    Examples:
      impact-rig analyze session.mcap --json > results.json
      impact-rig analyze runs/* --json > all.json
      impact-rig analyze session.mcap --reject 17 --accept "steel small/3.1"
      impact-rig analyze --cutoff off --hammer-unit N hit_1.npy hit_2.npy
      impact-rig analyze --channels bench.toml *.csv
    """,
)
@options.files_argument
@options.full_option
@options.json_option
@click.option(
    "--accept",
    multiple=True,
    metavar="HIT",
    help="Take a hit into the mean: record number, SAMPLE/IMPACT[.ATTEMPT] or file; repeatable.",
)
@click.option(
    "--reject", multiple=True, metavar="HIT", help="Leave a hit out of the mean; repeatable."
)
@options.measurement_options
@click.option(
    "--workers",
    type=click.IntRange(1),
    metavar="N",
    help="Processes for many recordings. [one per core]",
)
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Use this Dask cluster, whose workers see the same paths.",
)
@click.pass_context
def analyze(context: click.Context, /, **values: Any) -> None:
    """Estimate contact time, stiffness and damping from recordings or plain traces.

    A recording (.mcap, or the folder of a run) gives the numbers of the live run, bit by bit;
    many make one table. Plain traces (.lvm, .tdms, .uff, .mat, .csv, .npy and more), one hit
    each, give contact times, and with masses stiffness and damping. Columns by default: hammer;
    time, hammer; time, hammer, specimen. A results.json is shown again. Exit code 2: some file
    could not be used.
    """
    load_module("impact_rig.cli.analyze").run(context, **values)


@click.command(
    "info",
    epilog="""
    \b
    Examples:
      impact-rig info session.mcap
      impact-rig info runs/*/session.mcap --json
      impact-rig info session.mcap --extract rig_files
    Exit code: 0 if every recording is sound, 1 if one is damaged or was never closed,
    2 if one cannot be read at all.
    """,
)
@options.files_argument
@click.option(
    "--extract",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="FOLDER",
    help="Write the files that are attached to the recordings into a folder.",
)
@options.json_option
def info(**values: Any) -> None:
    """See what a recording holds, and whether it is sound.

    Reads all of it and checks every checksum: samples, hits and verdicts, topics, gaps and losses,
    versions, notes and attachments. FILE is a recording (.mcap) or the folder of a run. Recordings
    of other ROS 2 systems are shown topic by topic. No ROS is needed.
    """
    load_module("impact_rig.cli.info").run(**values)


@click.command(
    "replay",
    epilog="""
    \b
    Examples:
      impact-rig replay runs/2026-05-04T10-00-00        as it happened
      impact-rig replay session.mcap --rate 5 --loop 0  five times as fast, for ever
      impact-rig replay session.mcap --estimate         the tables, by a fresh estimator
      impact-rig replay session.mcap --estimate --json > results.json
    The services replayer/pause and replayer/resume do what they say. `ros2 bag play` plays parts,
    other topics and a clock.
    """,
)
@click.argument("file", metavar="RUN", type=click.Path(path_type=Path))
@click.option(
    "--rate",
    type=click.FloatRange(0.001, FASTEST),
    default=1.0,
    help="Part of the original speed. [1]",
)
@click.option("--loop", type=click.IntRange(0), default=1, help="How often; 0: for ever. [1]")
@click.option("--namespace", default="", help="ROS namespace to replay in. [none]")
@options.network_option
@click.option("--estimate", is_flag=True, help="Estimate with a fresh estimator, and print.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for results.json; with --estimate. [not written]",
)
@options.json_option
@click.pass_context
def replay(context: click.Context, /, **values: Any) -> None:
    """Publish a recording (.mcap) or the folder of a run again.

    Set-up, blocks and releases are published at the original speed, byte for byte, for an
    estimator or a visualizer. With --estimate a fresh estimator in this process takes them, and
    gives the numbers of the live run, and of `impact-rig analyze`, bit by bit.
    """
    load_module("impact_rig.cli.replay").run(context, **values)


@click.command(
    "export",
    epilog="""
    \b
    Examples:
      impact-rig export session.mcap -o session.mat
      impact-rig export session.mcap -o brass.uff --samples "brass small" --filtered
      impact-rig export session.mcap -o hits --one-file-per-hit --format csv
      impact-rig export session.mcap -o results.csv --what results
      impact-rig export session.mcap -o results.json
      impact-rig export damaged.mcap -o sound.mcap
      impact-rig export results.json --for mujoco --sample "steel small" -o steel.xml

    Channels are called "aluminium large/3.1 hammer" (sample, impact, attempt, body) or
    "aluminium large/mean hammer", in m/s^2. In a mean, time 0 is the middle of the hammer pulse.

    The suffix .mcap makes a sound copy of a damaged recording, without what has no valid checksum.
    Exit code: 1 if the old one is damaged.

    --for fits the parameters of a simulator's contact law, so that duration and restitution at the
    measured speed are met.
    """,
)
@click.argument(
    "recording",
    metavar="RUN",
    type=click.Path(path_type=Path),
)
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="OUT",
    type=click.Path(path_type=Path),
    help="The file, whose suffix tells its format: .uff, .tdms, .mat, .h5, .csv, .json (results"
    " alone) or .mcap (a sound copy); .xml or .sdf with --for; with --one-file-per-hit a folder."
    " Nothing is overwritten.",
)
@click.option(
    "--what",
    type=Parsed(parse_parts),
    metavar="PART,...",
    help="Of hits, means and results. [results in .json, hits in .csv, else hits,means]",
)
@click.option(
    "--samples",
    "--sample",
    multiple=True,
    metavar="NAME",
    help="Only this sample. May be repeated.",
)
@click.option(
    "--hits",
    multiple=True,
    metavar="HIT",
    help="Only this hit: by record number, SAMPLE/IMPACT or SAMPLE/IMPACT.ATTEMPT. May be"
    " repeated.",
)
@click.option("--accepted-only", is_flag=True, help="Only hits that are in a mean.")
@click.option("--filtered", is_flag=True, help="Hits after baseline and low-pass.")
@click.option("--one-file-per-hit", is_flag=True, help="One file per hit or mean, in folder OUT.")
@click.option(
    "--format",
    "suffix",
    metavar="FORMAT",
    help="Of the files of --one-file-per-hit: uff, tdms, mat, h5 or csv.",
)
@click.option(
    "--for",
    "engine",
    type=click.Choice(SIMULATORS),
    help="Write the contact of a sample for this simulator.",
)
@click.pass_context
def export(context: click.Context, /, **values: Any) -> None:
    """Write what a recording holds for other tools: traces of hits, their means, and results.

    RUN is a recording (.mcap) or the folder of a run; with --for a results.json as well. No ROS is
    needed.
    """
    load_module("impact_rig.cli.export").run(context, **values)


@click.command(
    "view",
    epilog="""
    \b
    Examples:
      impact-rig view runs/2026-05-04T10-00-00       in a window
      impact-rig view session.mcap -o campaign.rrd   as a file for Rerun
      impact-rig view session.mcap --web             in a browser, until Ctrl-C
      impact-rig view results.json                   tables and figures alone
      impact-rig view runs/* --connect rerun+http://desk:9876/proxy
    """,
)
@click.argument(
    "paths", nargs=-1, required=True, metavar="RUN...", type=click.Path(path_type=Path)
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE.rrd",
    help="Write a file for Rerun; none is overwritten.",
)
@click.option(
    "--connect",
    default="",
    metavar="ADDRESS",
    help="Show it in the viewer at rerun+http://HOST:9876/proxy.",
)
@click.option("--web", is_flag=True, help="Serve a page for this host's browsers, until Ctrl-C.")
@click.option("--spawn", is_flag=True, help="Open a window until it is closed; the default.")
@click.option("--fit", is_flag=True, help="Fit the model too: 0.1 s for each sample.")
def view(**values: Any) -> None:
    """See model and measurement in Rerun: every hit, the samples, the campaign, the tables.

    RUN is a recording (.mcap) or the folder of a run, results (.json), or a view
    that was written before (.rrd). In the viewer each campaign is a recording of its own. No ROS
    is needed.
    """
    load_module("impact_rig.cli.view").run(**values)


@click.command(
    "report",
    epilog="""
    \b
    Examples:
      impact-rig report runs/2025-01-31T12-00-00
      impact-rig report session.mcap -o steel.html
    Nothing is overwritten. A browser prints the page on A4.
    """,
)
@click.argument("path", metavar="RUN", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    type=click.Path(path_type=Path, dir_okay=False),
    help="The HTML file. [report.html in the run's folder]",
)
def report(**values: Any) -> None:
    """Write a report: one HTML file that needs nothing else.

    What was measured and with what, tables with uncertainties and budgets, the paper's figures,
    traces with models and residuals, hits left out and why. RUN is a recording (.mcap) or the
    folder of a run, or a results.json, which has no traces. No ROS is needed.
    """
    load_module("impact_rig.cli.report").run(**values)


@click.command(
    "doctor",
    epilog="""
    \b
    Examples:
      impact-rig doctor
      impact-rig doctor --json
    Exit code: 0 if the rig can work, 1 if something that it needs is broken.
    """,
)
@options.json_option
def doctor(**values: Any) -> None:
    """See what is installed and what is broken.

    Lists Python, its libraries, ROS 2 and its settings, drivers, disk and shared memory, and lets
    two processes exchange a message.
    """
    load_module("impact_rig.cli.doctor").run(**values)


@click.command(
    "import",
    epilog="""
    \b
    Examples:
      impact-rig import hit_*.lvm -o hits.mcap --sample "brass small"
      impact-rig import *.npy -o hits.mcap --hammer-unit N --hammer-mass 1kg
      impact-rig import --template run/1.csv > bench.toml
      impact-rig import run/*.csv -o hits.mcap --channels bench.toml

    Each file is one hit, in the order given: LabVIEW .lvm, .tdms, UFF 58, .mat, text, .npy, .wav,
    HDF5. Numbers are kept as they are in the file, bit by bit, with the calibration beside them.
    A force hammer's channel becomes acceleration by its mass.

    A hit was when its file says so: .lvm (without a time zone: taken as UTC), .tdms, and .mat and
    HDF5 of impact-rig export. Where a file does not, or names a time before the end of the hit
    before, the hit comes a second after that end, the first one a second into 1970. The same
    files make the same recording. Exit code: 2 if a file could not be used, which the others do
    not suffer from.
    """,
)
@click.argument("files", nargs=-1, metavar="FILE...", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    metavar="OUT.mcap",
    type=click.Path(path_type=Path),
    help="The recording; it must not exist.",
)
@click.option(
    "--template",
    is_flag=True,
    help="Print a file for --channels, made of what FILE says, or one with comments, and stop.",
)
@options.measurement_options
def import_(**values: Any) -> None:
    """Make a recording of other instruments' files, one hit each, all of one sample.

    `analyze`, `replay` and the tools of others take it as one of the rig's own.
    """
    load_module("impact_rig.cli.import_").run(**values)
