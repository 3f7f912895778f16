"""``impact-rig hammer``: what a person may want of the hammer of a rig that is up."""

import click

from impact_rig.cli import options

STATE = "state"
ACTIONS = (STATE, "arm", "disarm", "stop", "reset", "confirm")
RIG_TIMEOUT = 10.0
"""How long the rig may take to be found, and to answer [s]."""


@click.command(
    epilog="""
    \b
    Examples:
      impact-rig hammer state        where it is, whether it is armed, and why
      impact-rig hammer stop         emergency stop: nothing lets it go any more
      impact-rig hammer reset        end an emergency stop; it stays disarmed
      impact-rig hammer arm          give the enable, after a stop or a loss
      impact-rig hammer disarm       take it back
      impact-rig hammer confirm      it has been put back into its holder
    """
)
@click.argument("action", type=click.Choice(ACTIONS), default=STATE)
@options.namespace_option
@options.network_option
def command(action: str, namespace: str, network: bool) -> None:
    """Ask the hammer of a rig that is up what it does, or for something.

    ACTION is one of the words below. The stop is one by software: it takes a second, and does
    not replace a switch in the supply of magnet or latch.
    """
    from impact_rig.nodes.client import HammerClient

    options.set_discovery(network=network)
    with HammerClient(namespace, RIG_TIMEOUT) as client:
        click.echo(client.describe() if action == STATE else client.ask(action))
