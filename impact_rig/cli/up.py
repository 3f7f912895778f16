"""``impact-rig up``: start the nodes of a rig."""

import sys
from pathlib import Path

import click

from impact_rig.cli import options
from impact_rig.cli.rigs.recording_options import recording_options
from impact_rig.configuration import run
from impact_rig.configuration.calibration_warnings import find_rig_warnings
from impact_rig.configuration.processes import LOG_NAME, RecordingPlan, list_rig_processes
from impact_rig.configuration.rig_file import read_template
from impact_rig.core.errors import RigError


@click.command(
    epilog="""
    \b
    Examples:
      impact-rig up                            the paper's rig, virtual
      impact-rig up --template > my-rig.toml   a rig file to fill in
      impact-rig up --rig-file my-rig.toml     your own samples
      impact-rig up --set hammer.swing_time=0.3
      impact-rig up --viewer web               watch it in a browser
      impact-rig up --continuous --record-stream    all that the accelerometers see
      impact-rig up --bag --set recorder.split_duration=3600    a file an hour
    On two computers, the devices at one, the same rig file and ROS_DOMAIN_ID at both:
      impact-rig up --network --only hammer --only accelerometer
      impact-rig up --network --only estimator --only recorder --only campaign
    Then, in another terminal:
      impact-rig campaign
    """
)
@options.rig_file_option
@options.virtual_rig_options
@options.continuous_option
@options.output_option
@recording_options
@options.network_option
@click.option("--namespace", default="", help="ROS namespace of the rig. [none]")
@click.option("--record/--no-record", default=True, help="Record everything to MCAP. [yes]")
@click.option("--visualizer/--no-visualizer", default=True, help="Write a Rerun view. [yes]")
@options.viewer_option
@click.option(
    "--only",
    multiple=True,
    metavar="NODE",
    help="Start this node of the rig, and only those named so; repeatable. The others run"
    " elsewhere: every other option goes for the whole rig, and is the same there. [all]",
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NODE.PARAMETER=VALUE",
    help="Set any ROS parameter of a node; repeatable.",
)
@click.option("--template", is_flag=True, help="Print the paper's rig file and end.")
@click.option("--stop-with-input", is_flag=True, hidden=True)
@click.option("--log-file", type=click.Path(path_type=Path), hidden=True)
def command(
    rig_file: Path | None,
    plant: str | None,
    seed: int | None,
    faults: float | None,
    continuous: bool,
    output: Path | None,
    recording: RecordingPlan,
    network: bool,
    namespace: str,
    record: bool,
    visualizer: bool,
    viewers: tuple[str, ...],
    only: tuple[str, ...],
    settings: tuple[str, ...],
    template: bool,
    stop_with_input: bool,
    log_file: Path | None,
) -> None:
    """Start the nodes of a rig, each its own process, until Ctrl-C.

    Everything is recorded into one folder, runs/<time>/ unless --output says otherwise: that of
    the computer which starts the recorder. Several computers make one rig when each starts some
    of the nodes (--only) and lets them find each other (--network).
    """
    if template:
        click.echo(read_template(), nl=False)
        return
    from impact_rig.cli.rigs.node_processes import run_nodes
    from impact_rig.reporting.terminal.console import print_warning

    rig = run.load_rig_file(rig_file)
    for warning in find_rig_warnings(rig.setup):
        print_warning(warning)
    overrides = run.parse_settings(settings)
    folder = run.choose_run_folder(output)
    options.set_discovery(network=network)
    processes = list_rig_processes(
        folder.resolve(),
        rig_file=str(rig_file.resolve()) if rig_file else "",
        virtual=run.merge_virtual(rig, plant=plant, seed=seed, faults=faults),
        swing=rig.hammer,
        continuous=continuous,
        record=record,
        recording=recording,
        visualize=visualizer,
        viewers=viewers,
        overrides=overrides,
        only=only,
    )
    if any("output" in process.parameters for process in processes):
        run.make_run_folder(folder)
    log = log_file.open("w", encoding="utf-8") if log_file else sys.stdout
    code = run_nodes(processes, log, namespace=namespace, stop_with_input=stop_with_input)
    if any(process.name == "recorder" for process in processes):
        click.echo(f"recording: {folder / recording.name}")
    if code:
        where = log_file or "above"
        raise RigError(f"a node ended by itself, and the rig with it: see {where} ({LOG_NAME})")
