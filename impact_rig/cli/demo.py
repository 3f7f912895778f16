"""``impact-rig demo``: a whole campaign on the virtual rig, in separate processes."""

from pathlib import Path

import click

from impact_rig.cli import options
from impact_rig.cli.rigs.recording_options import list_recording_arguments, recording_options
from impact_rig.configuration import run
from impact_rig.configuration.processes import (
    LOG_NAME,
    PAGE,
    VIEW_NAME,
    RecordingPlan,
    list_rig_processes,
    make_viewer_parameters,
)
from impact_rig.configuration.rig_file import RigFile
from impact_rig.devices.drivers import VIRTUAL, read_driver_name

START_TIMEOUT = 90.0
"""How long the processes may take to start [s]: seconds on two cores, more on a busy host."""
SETTINGS = ("hammer.swing_time=0.02", "accelerometer.trigger_timeout=0.1")
"""Nobody waits for a simulation: a tenth of the paper's swing, and a short wait for triggers
that never come."""
ATTEMPTS = 50
"""Rejected hits in a row before the demo gives up [-]: with every fault at 10 % about half the
hits are bad."""
SUBSCRIBERS = 3
"""Estimator, recorder and visualizer listen before the first hit, so that the view has all."""
VIEW_TIMEOUT = 10.0
"""How long the visualizer is waited for [s]: it may be missing its library, and the campaign goes
on without it."""

PAGE_NOTICE = "the view is at"
"""What the visualizer says of its web page."""


@click.command(
    epilog="""
    \b
    Examples:
      impact-rig demo                          the paper's campaign, 120 hits
      impact-rig demo --samples "steel small" "aluminium large" --impacts 3
      impact-rig demo --faults 0.1             what goes wrong on a real rig
      impact-rig demo --impacts 12 --keep 10   the ten most consistent of twelve
      impact-rig demo --continuous             impacts found in a running stream
      impact-rig demo --viewer spawn           watch it in Rerun
      impact-rig demo --json > results.json
    """
)
@options.rig_file_option
@options.virtual_rig_options
@options.continuous_option
@options.output_option
@recording_options
@options.viewer_option
@options.samples_option
@options.impacts_option
@options.keep_option
@options.json_option
def command(
    rig_file: Path | None,
    plant: str | None,
    seed: int | None,
    faults: float | None,
    continuous: bool,
    output: Path | None,
    recording: RecordingPlan,
    viewers: tuple[str, ...],
    samples: tuple[str, ...],
    impacts: int,
    keep: int,
    as_json: bool,
) -> None:
    """Run a whole campaign on the virtual rig, each node its own process.

    The hammer is released, two accelerometers stream, every hit is judged; contact time,
    stiffness and damping of every sample are printed beside the published values, and
    everything is recorded.
    """
    from impact_rig.cli.rigs.campaign_view import CampaignView, report_outcome, run_campaign
    from impact_rig.cli.rigs.running_rig import run_rig, use_private_domain
    from impact_rig.reporting.terminal.console import make_console

    options.check_keep(keep, impacts)
    rig = run.load_rig_file(rig_file)
    _check_virtual(rig)
    run.check_samples(rig, samples)
    make_viewer_parameters(viewers)
    list_rig_processes("", virtual=rig.virtual, continuous=continuous, recording=recording)
    folder = run.make_run_folder(output)
    options.set_discovery(network=False)
    arguments = [word for setting in SETTINGS for word in ("--set", setting)]
    arguments += list_recording_arguments(recording)
    arguments += ["--continuous"] if continuous else []
    arguments += [word for viewer in viewers for word in ("--viewer", viewer)]
    for name, value in (
        ("--rig-file", rig_file), ("--plant", plant), ("--seed", seed), ("--faults", faults),
    ):  # fmt: skip
        if value is not None:
            arguments += [name, str(value)]
    try:
        with use_private_domain(), run_rig(folder, arguments) as running:
            from impact_rig.nodes.campaign_client import CampaignClient
            from impact_rig.nodes.campaigning.request import CampaignRequest

            with CampaignClient() as client, CampaignView(make_console(stderr=True)) as view:
                client.wait_for_rig(START_TIMEOUT, running.check)
                # Of a running stream the accelerometers wait to hear that their hit was found.
                client.wait_for_listeners(SUBSCRIBERS + continuous, VIEW_TIMEOUT)
                if PAGE in viewers:
                    click.echo(running.find_line(PAGE_NOTICE, VIEW_TIMEOUT), err=True)
                request = CampaignRequest(samples, impacts, ATTEMPTS, keep_hits=keep)
                outcome = run_campaign(client, request, view)
    except KeyboardInterrupt:
        click.echo(f"stopped; the recording so far: {folder / recording.name}", err=True)
        raise
    report_outcome(outcome, folder, as_json=as_json)
    if not (folder / VIEW_NAME).exists():
        click.echo(f"no view was written: see {folder / LOG_NAME}", err=True)


def _check_virtual(rig: RigFile) -> None:
    """Raise `ParameterError` if a rig file names a device: a demonstration reaches no hammer."""
    for table in (rig.source, rig.holder):
        if read_driver_name(table) != VIRTUAL:
            raise table.make_error(
                "driver",
                f"the demo strikes the virtual rig only, and {table.place} names the driver"
                f" {read_driver_name(table)!r}: use `impact-rig up` and `impact-rig campaign`",
            )
