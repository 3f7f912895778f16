"""The commands: their options and help, light to load.

What a command does stands in the module of its name, which is loaded when it runs.
"""

import functools
import inspect
from collections.abc import Callable
from typing import Any

import click

from impact_rig.cli import options
from impact_rig.cli.options import FILE, FOLDER
from impact_rig.cli.rig_group import RigGroup
from impact_rig.cli.rig_options import RIG_OPTIONS
from impact_rig.cli.start import load_module
from impact_rig.version import __version__

HAMMER_ACTIONS = ("state", "arm", "disarm", "stop", "reset", "confirm")


@click.group(
    cls=RigGroup,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="""
    \b
    Examples:
      impact-rig demo                          the whole job, no hardware needed
      impact-rig analyze session.mcap          the tables of a recorded campaign
      impact-rig analyze --cutoff off hit*.npy contact times of plain traces
      impact-rig doctor                        when something does not work
      impact-rig COMMAND --help                more about one command
    """,
)
@click.version_option(__version__, "--version", prog_name="impact-rig")
def cli() -> None:
    """Strike samples with a pendulum hammer and estimate contact time, stiffness and damping."""


def _command(described: Callable[[], None]) -> click.Command:
    """Declare a command; its docstring is its help, its work `run` in the module of its name.

    The examples, in which lines stay as they are, stand below the options.
    """
    about, _, examples = (inspect.getdoc(described) or "").partition("\n\nExamples:")
    name = described.__name__

    @functools.wraps(described)
    def run(**values: Any) -> None:
        load_module(f"impact_rig.cli.{name}").run(**values)

    epilog = f"\b\nExamples:{examples}"
    return cli.command(name.rstrip("_"), help=about, epilog=epilog)(run)


@_command
@options.nodes_options
@options.campaign_options
@options.results_options
def demo() -> None:
    """Run a whole campaign on the virtual rig.

    Each node is a process. The hammer is released, two accelerometers stream, every hit is
    judged and recorded. Prints contact time, stiffness and damping of every sample.

    Examples:
      impact-rig demo                          the paper's campaign, 120 hits
      impact-rig demo --sample "steel small" --sample "aluminium large" --impacts 3
      impact-rig demo --faults 0.1             what goes wrong on a real rig
      impact-rig demo --plant contact --angles 5,10,20    metal on metal, at three speeds
      impact-rig demo --continuous             impacts found in a running stream
    """


@_command
@options.nodes_options
@options.resume_option
@options.rig_options
@click.option(
    "--visualizer/--no-visualizer", "visualize", default=True, help="Write a Rerun view. [yes]"
)
@options.make_list_option("--only", "NODE", RIG_OPTIONS["only"].text)
@options.make_list_option(
    "--set",
    "NODE.PARAMETER=VALUE",
    "Set a ROS parameter of a node, or source.KEY=VALUE of the rig file's table [source]",
    "settings",
)
@click.option("--template", is_flag=True, help="Print the paper's rig file and end.")
def up() -> None:
    """Start the nodes of a rig, each in its own process.

    They run until Ctrl-C, and record into one folder. Several computers make one rig when each
    starts some of the nodes (--only) and finds the others (--network).

    Examples:
      impact-rig up                            the paper's rig, virtual
      impact-rig up --template > my-rig.toml   a rig file to fill in
      impact-rig up --rig-file my-rig.toml     your own samples
      impact-rig up --resume runs/2026-11-23T15-00-00
    On one of two computers, with the same rig file and ROS_DOMAIN_ID:
      impact-rig up --network --only hammer --only accelerometer
    """


@_command
@click.option("--address", default="127.0.0.1", help="Where to serve it. [this computer alone]")
@click.option("--port", type=click.IntRange(0, 65535), default=8000, help="0: any. [8000]")
@click.option("--certificate", type=FILE, help="TLS certificate of this server, PEM. [no TLS]")
@click.option("--key", type=FILE, help="Its key. [in the same file]")
@options.rig_options
def page() -> None:
    """Serve a page for the person at a rig that is up.

    It says what to do, shows each hit, and has STOP, arm, mounted, pause, reject and notes as
    buttons. It asks the rig as every other program does. Ctrl-C ends the page, not the rig.

    Examples:
      impact-rig page                          for browsers of this computer
      impact-rig page --address 192.168.1.5    for a phone or tablet, by the link with its token
    """


@_command
@options.campaign_options
@click.option(
    "--ask/--no-ask",
    default=None,
    help="Wait until each sample is mounted. [yes, unless the hits are simulated]",
)
@options.make_quantity_option(
    "--check-mass",
    "kg",
    "150.2 g",
    "Operational check first: a free rigid mass, by its traces within 5 %. [as in the rig file]",
    0.0,
)
@options.notes_option
@options.resume_option
@options.make_quantity_option(
    "--wait", "s", "1 min", "How long to look for a rig that is being started. [7 s]"
)
@options.rig_options
@options.make_output_option(
    "Folder for results.json. [that of the recording, if it is on this computer]", "FOLDER"
)
@options.results_options
def campaign() -> None:
    """Run a campaign on a rig that is up, here or elsewhere.

    The rig's campaign node does the work. This command starts it, follows it, and asks you to
    mount the next sample, or to put the hammer back where no device does. When a device is lost,
    the campaign pauses and gives the reason. It goes on when the device is back and a person has
    armed the hammer (`impact-rig hammer arm`). --resume goes on with a campaign that ended early,
    on a rig that was started with the same option.

    Examples:
      impact-rig campaign                      the whole set, 10 hits each
      impact-rig campaign --sample "steel small" --impacts 5
      impact-rig campaign --angles 5,10,20     from each of these release angles
      impact-rig campaign --check-mass "150.2 g"    strike a free rigid mass first
      impact-rig campaign --resume runs/2026-11-23T15-00-00    go on with a campaign
      impact-rig campaign --namespace rig1 --network    a rig on another computer
    """


@_command
@click.argument("name", required=False, metavar="[DRIVER]")
@click.option(
    "--check",
    "rig_file",
    type=FILE,
    metavar="RIG_FILE",
    help="Open source and holder of a rig file, and close them again. The hammer stays held.",
)
def devices() -> None:
    """See which drivers and devices there are, and try them.

    A driver whose library is missing says how to get it. The search changes no setting of any
    device.

    Examples:
      impact-rig devices                       all drivers, and what they find
      impact-rig devices scpi                  one driver, with a table to copy
      impact-rig devices --check my-rig.toml   try the devices of a rig file

    Any package may bring drivers by entry points. Exit code: 1 if a device of the rig file is
    missing or cannot do what the file says.
    """


@_command
@click.argument("rig_file", type=FILE)
@options.make_quantity_option(
    "--known-mass",
    "kg",
    "150 g",
    "Of all that moves with the struck body, its sensor included. [back to back]",
)
@click.option(
    "--sensor",
    "channel",
    type=click.Choice(["hammer", "specimen"]),
    help="The one under test; the other is the reference. [with a known mass: hammer]",
)
@options.make_quantity_option(
    "--reference-uncertainty",
    "dimensionless",
    "0.75 %",
    "Standard uncertainty of the reference's sensitivity: half of what its certificate says for"
    " k = 2. [0]",
    0.0,
)
@options.make_quantity_option(
    "--mass-uncertainty", "kg", "10 mg", "Standard uncertainty of the known mass. [0]", 0.0
)
@click.option(
    "--recording",
    type=FILE,
    help="Take the hits of a recording. [strike now, on the source of the rig file]",
)
@click.option("--sample", default="", metavar="NAME", help="Only hits on this sample. [all]")
@click.option(
    "--hits",
    type=click.IntRange(3),
    default=10,
    metavar="N",
    help="Number of hits to strike; Ctrl-C ends before. [10]",
)
def calibrate() -> None:
    """Find the sensitivity of a sensor from hits.

    Each hit gives a ratio, by least squares over the contact. Hits whose traces do not fit are
    left out and named. The uncertainty follows the GUM.

    Examples:
      impact-rig calibrate rig.toml --sensor specimen --reference-uncertainty "0.75 %"
      impact-rig calibrate rig.toml --known-mass 150.2g --mass-uncertainty 10mg
      impact-rig calibrate rig.toml --known-mass 150g --recording session.mcap

    Back to back, the default: the sensor under test is mounted on the reference, on the other
    channel, and both see the same acceleration. Known mass: the hammer strikes a body that is free
    to move; force is mass times acceleration. Strike by hand, in the direction of the sensors.
    The new sensitivity is printed as lines for the rig file.
    """


@_command
@click.argument("action", type=click.Choice(HAMMER_ACTIONS), default=HAMMER_ACTIONS[0])
@click.option(
    "--within",
    type=click.FloatRange(0.1, 60.0),
    default=2.0,
    metavar="S",
    help="Do not arm, reset or confirm later than this [s]. [2]",
)
@options.rig_options
def hammer() -> None:
    """Show the state of a rig's hammer, arm, disarm or stop it.

    ACTION is one of the words below. The stop is one by software: it takes a second, and does
    not replace a switch in the supply of magnet or latch.

    Examples:
      impact-rig hammer state        where it is, whether it is armed, and why
      impact-rig hammer stop         emergency stop: the hammer is not released any more
      impact-rig hammer reset        end an emergency stop; the hammer stays disarmed
      impact-rig hammer arm          allow releases, after a stop or a lost device
      impact-rig hammer disarm       forbid releases
      impact-rig hammer confirm      the hammer is back in its holder
    """


@_command
@options.files_argument
@options.results_options
@options.make_list_option(
    "--accept", "HIT", "Take a hit into the mean: record number, SAMPLE/IMPACT[.ATTEMPT] or file"
)
@options.make_list_option("--reject", "HIT", "Leave a hit out of the mean")
@options.measurement_options
@options.recorded_rig_option
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
@click.option("--trend", is_flag=True, help="Control sample and check mass, run by run: a change?")
@options.make_output_option("With --trend: a page, HTML, with charts and calibrations.")
def analyze() -> None:
    """Estimate contact time, stiffness and damping from files.

    A recording (.mcap, or the folder of a run) gives the numbers of the live run, bit by bit;
    many make one table. Plain traces (.lvm, .tdms, .uff, .mat, .csv, .npy and more), one hit
    each, give contact times, and with masses stiffness and damping. Columns by default: hammer;
    time, hammer; time, hammer, specimen. A results.json is shown again. Exit code 2: some file
    could not be used.

    Examples:
      impact-rig analyze runs/* --json > all.json
      impact-rig analyze session.mcap --reject 17 --accept "steel small/3.1"
      impact-rig analyze --cutoff off --hammer-unit N hit_1.npy hit_2.npy
      impact-rig analyze --channels bench.toml *.csv
    """


@_command
@options.files_argument
@click.option(
    "--extract",
    type=FOLDER,
    metavar="FOLDER",
    help="Write the files that are attached to the recordings into a folder.",
)
@options.recorded_rig_option
@options.json_option
def info() -> None:
    """See what a recording holds, and whether it is sound.

    Reads all of it and checks every checksum: samples, hits and verdicts, topics, gaps and losses,
    versions, notes and attachments. FILE is a recording (.mcap) or the folder of a run. Recordings
    of other ROS 2 systems are shown topic by topic. No ROS is needed.

    Examples:
      impact-rig info runs/*/session.mcap --json
      impact-rig info session.mcap --extract rig_files
    Exit code: 0 if every recording is sound, 1 if one is damaged or was never closed,
    2 if one cannot be read at all.
    """


@_command
@click.argument("file", metavar="RUN", type=FILE)
@options.make_rig_option("rate", default=1.0)
@options.make_rig_option("loop", default=1)
@options.rig_options
@click.option("--estimate", is_flag=True, help="Estimate with a fresh estimator, and print.")
@options.json_option
def replay() -> None:
    """Publish a recording again.

    RUN is a recording (.mcap) or the folder of a run. Set-up, blocks and releases are
    published at the original speed, byte for byte, for an estimator or a visualizer. With
    --estimate a fresh estimator in this process receives them. It gives the numbers of the
    live run, and of `impact-rig analyze`, bit by bit.

    Examples:
      impact-rig replay runs/2026-05-04T10-00-00        as it happened
      impact-rig replay session.mcap --rate 5 --loop 0  five times as fast, for ever
      impact-rig replay session.mcap --estimate         the tables, by a fresh estimator
    The services replayer/pause and replayer/resume pause and resume. `ros2 bag play` plays parts,
    other topics and a clock.
    """


@_command
@click.argument("files", nargs=-1, metavar="FILE...", type=FILE)
@options.make_output_option("The recording; it must not exist.", "OUT.mcap")
@click.option(
    "--template",
    is_flag=True,
    help="Print a file for --channels and end: one made from FILE, or one with comments.",
)
@options.measurement_options
def import_() -> None:
    """Make a recording of other instruments' files.

    Each file is one hit; all are of one sample. `analyze`, `replay` and other programs read it
    like a recording of the rig.

    Examples:
      impact-rig import hit_*.lvm -o hits.mcap --sample "brass small"
      impact-rig import *.npy -o hits.mcap --hammer-unit N --hammer-mass 1kg
      impact-rig import --template run/1.csv > bench.toml
      impact-rig import run/*.csv -o hits.mcap --channels bench.toml

    Each file is one hit, in the order given: LabVIEW .lvm, .tdms, UFF 58, .mat, text, .npy, .wav,
    HDF5. Numbers are kept bit by bit, with the calibration beside them. A force hammer's channel
    becomes acceleration by its mass. A hit whose file states no time comes a second after the one
    before. The same files make the same recording. Exit code: 2 if a file could not be used.
    """


@_command
@click.argument("recording", metavar="RUN", type=FILE)
@options.make_output_option(
    "The file, whose suffix tells its format: .uff, .tdms, .mat, .h5, .csv, .json (results alone)"
    " or .mcap (a sound copy); .xml or .sdf with --for; with --one-file-per-hit a folder."
    " Nothing is overwritten.",
    "OUT",
    required=True,
)
@click.option(
    "--what",
    type=click.Choice(["hits", "means", "results"]),
    help="Only these. [results in .json, hits in .csv, else hits and means]",
)
@options.samples_option
@options.make_list_option(
    "--hit", "HIT", "Only this hit: record number or SAMPLE/IMPACT[.ATTEMPT]", "hits"
)
@click.option("--accepted-only", is_flag=True, help="Only hits that are in a mean.")
@click.option("--filtered", is_flag=True, help="Hits after baseline and low-pass.")
@click.option(
    "--one-file-per-hit",
    "suffix",
    metavar="FORMAT",
    help="One file per hit or mean, in folder OUT: uff, tdms, mat, h5 or csv.",
)
@options.recorded_rig_option
@click.option(
    "--for",
    "engine",
    type=click.Choice(["mujoco", "sdf"]),
    help="Write the contact of a sample for this simulator.",
)
def export() -> None:
    """Write hits, mean traces and results for other programs.

    RUN is a recording (.mcap) or the folder of a run; with --for a results.json as well. No ROS is
    needed.

    Examples:
      impact-rig export session.mcap -o brass.uff --sample "brass small" --filtered
      impact-rig export session.mcap -o hits --one-file-per-hit csv
      impact-rig export session.mcap -o results.csv --what results
      impact-rig export damaged.mcap -o sound.mcap
      impact-rig export results.json --for mujoco --sample "steel small" -o steel.xml

    Channels are called "aluminium large/3.1 hammer" (sample, impact, attempt, body) or
    "aluminium large/mean hammer", in m/s^2. In a mean, time 0 is the middle of the hammer pulse.
    A copy (.mcap) is without what has no valid checksum; exit code: 1 if the old one is damaged.
    --for fits a simulator's contact law to the duration and restitution at the measured speed.
    """


@_command
@click.argument("paths", nargs=-1, required=True, metavar="RUN...", type=FILE)
@options.make_output_option("Write a file for Rerun, which must not exist.", "FILE.rrd")
@click.option(
    "--web", is_flag=True, help="Serve a page for browsers of this computer, until Ctrl-C."
)
@options.recorded_rig_option
def view() -> None:
    """See model and measurement in Rerun.

    It shows every hit, the samples, the campaign and the tables. RUN is a recording (.mcap),
    the folder of a run, or results (.json). The viewer shows each campaign as a separate
    recording. No ROS is needed.

    Examples:
      impact-rig view runs/2026-05-04T10-00-00       in a window
      impact-rig view session.mcap -o campaign.rrd   as a file for Rerun
      impact-rig view results.json                   tables and figures alone
    """


@_command
@click.argument("path", metavar="RUN", type=FILE)
@options.make_output_option("The HTML file. [report.html in RUN]")
@click.option(
    "--rig-file",
    type=FILE,
    help="Laboratory, report, items, limits from this file. [that of the recording]",
)
@options.make_list_option("--set", "TABLE.KEY=TEXT", "Say this in place of the rig file", "texts")
@click.option(
    "--check", "is_check", is_flag=True, help="List what a formal report (ISO/IEC 17025) lacks."
)
@click.option(
    "--final", "is_final", is_flag=True, help="Refuse to write it while anything of that lacks."
)
@click.option(
    "--for",
    "audience",
    type=click.Choice(["customer", "laboratory"]),
    help="With advice and opinions for the laboratory. [customer, where it is signed]",
)
@click.option(
    "--data", "with_data", is_flag=True, help="Beside it the results as XML (DCC) and JSON."
)
@click.option("--short", "is_short", is_flag=True, help="Without the annex: two pages.")
@options.make_list_option("--accept", "HIT", "Take a hit into the mean, as in analyze")
@options.make_list_option("--reject", "HIT", "Leave a hit out of the mean")
@click.option("--reason", default="", metavar="TEXT", help="Why.")
@click.option("--who", default="", metavar="NAME", help="Who decided that.")
@click.option(
    "--printed-model",
    "with_printed",
    is_flag=True,
    help="Draw the model as printed in every figure. [where it is nearest to the sample]",
)
@options.recorded_rig_option
def report() -> None:
    """Write a report: one HTML file that needs no other file.

    What was measured and with what, tables with uncertainties and budgets, the paper's figures,
    traces with models and residuals, rejected hits and why. RUN is a recording (.mcap) or the
    folder of a run, or a results.json, which has no traces. No ROS is needed.

    Examples:
      impact-rig report runs/2025-01-31T12-00-00
      impact-rig report session.mcap -o steel.html --set report.number=4711
      impact-rig report runs/2025-01-31T12-00-00 --check
      impact-rig report session.mcap --reject 17 --reason "loose cable" --who "A. Berg"
    Nothing is overwritten. A browser prints the page on A4.
    """


@_command
def doctor() -> None:
    """See what is installed and what is broken.

    Lists Python, its libraries, ROS 2 and its settings, drivers, disk and shared memory, and lets
    two processes exchange a message.

    Examples:
      impact-rig doctor
    Exit code: 0 if the rig can work, 1 if something that it needs is broken.
    """
