"""``impact-rig campaign``: run a campaign on a rig that is up."""

from datetime import datetime
from pathlib import Path

import click

from impact_rig.cli import options
from impact_rig.configuration.processes import make_run_folder_name

LOOKING = "looking for the rig"
RIG_TIMEOUT = 10.0
"""How long the rig may take to be found [s]."""


@click.command(
    epilog="""
    \b
    Examples:
      impact-rig campaign                      the whole set, 10 hits each
      impact-rig campaign --samples "steel small" --impacts 5
      impact-rig campaign --impacts 12 --keep 10    the ten most consistent of twelve
      impact-rig campaign --notes "new tip, 21 °C"
      impact-rig campaign --namespace rig1 --network    a rig on another host
    """
)
@options.samples_option
@options.impacts_option
@options.keep_option
@click.option(
    "--attempts",
    type=click.IntRange(1),
    help="Rejected hits in a row before giving up. [the rig's own limit]",
)
@click.option(
    "--ask/--no-ask",
    default=None,
    help="Wait until each sample is mounted. [yes, unless the hits are simulated]",
)
@click.option(
    "--notes", default="", metavar="TEXT", help="What the recording should say of this campaign."
)
@click.option("--namespace", default="", help="ROS namespace of the rig. [none]")
@options.network_option
@click.option(
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for results.json. [that of the recording, if it is on this host]",
)
@options.json_option
def command(
    samples: tuple[str, ...],
    impacts: int,
    keep: int,
    attempts: int | None,
    ask: bool | None,
    notes: str,
    namespace: str,
    network: bool,
    output: Path | None,
    as_json: bool,
) -> None:
    """Run a campaign on a rig that is up, here or on another host.

    The rig's campaign node does the work; this command starts it, follows it, and asks for the
    next sample to be mounted, and for the hammer to be put back where nothing else does that.
    When a device is lost, the campaign pauses, says why, and goes on when it is back; after an
    emergency stop it goes on when the hammer is reset and armed: see `impact-rig hammer`.
    """
    from impact_rig.cli.rigs.campaign_view import CampaignView, report_outcome, run_campaign
    from impact_rig.nodes.campaign_client import CampaignClient
    from impact_rig.nodes.campaigning.request import CampaignRequest
    from impact_rig.reporting.terminal.console import make_console

    options.check_keep(keep, impacts)
    options.set_discovery(network=network)
    console = make_console(stderr=True)
    with CampaignClient(namespace) as client, CampaignView(console, LOOKING) as view:
        client.wait_for_rig(RIG_TIMEOUT)
        if notes:
            client.publish_note(notes, RIG_TIMEOUT)
        confirm = not client.is_simulated if ask is None else ask
        outcome = run_campaign(
            client, CampaignRequest(samples, impacts, attempts or 0, confirm, keep), view
        )
    recorded = Path(outcome.recording) if outcome.recording else None
    if output is None:
        is_here = recorded is not None and recorded.exists()
        output = (
            recorded.parent
            if recorded is not None and is_here
            else Path(make_run_folder_name(datetime.now().astimezone()))
        )
    report_outcome(outcome, output, as_json=as_json)
