"""``impact-rig hammer``: the hammer of a rig that is up."""

import click

from impact_rig.cli.options import set_discovery
from impact_rig.nodes.client import HammerClient

ACT_TIMEOUT = 10.0
"""Time limit for finding the rig, and for its answer [s]: a stop does not give up soon."""
LOOK_TIMEOUT = 2.0
"""The same for who only looks [s]."""


def run(action: str, within: float, namespace: str, network: bool) -> None:
    """Run the command; its options are declared in `commands.py`."""
    set_discovery(network=network)
    timeout = LOOK_TIMEOUT if action == "state" else ACT_TIMEOUT
    with HammerClient(namespace, timeout) as client:
        click.echo(client.describe() if action == "state" else client.ask(action, within))
