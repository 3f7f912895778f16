"""``impact-rig hammer``: the hammer of a rig that is up."""

import click

from impact_rig.cli.options import set_discovery
from impact_rig.nodes.client import HammerClient

RIG_TIMEOUT = 10.0
"""Time limit for finding the rig, and for its answer [s]."""


def run(action: str, namespace: str, network: bool) -> None:
    """Run the command; its options are declared in `commands.py`."""
    set_discovery(network=network)
    with HammerClient(namespace, RIG_TIMEOUT) as client:
        click.echo(client.describe() if action == "state" else client.ask(action))
