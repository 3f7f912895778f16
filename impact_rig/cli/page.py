"""`impact-rig page`: a page for the person at a rig that is up."""

import sys
from pathlib import Path

from impact_rig.cli import options
from impact_rig.cli.up import PAGE_NODE, RunningNodes, show_page
from impact_rig.configuration.node_claim import check_free, join_names
from impact_rig.configuration.processes import NodeProcess
from impact_rig.core.given.errors import RigError


def run(
    address: str,
    port: int,
    certificate: Path | None,
    key: Path | None,
    namespace: str,
    network: bool,
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    options.set_discovery(network=network)
    paths = {"certificate": certificate, "key": key}
    given = {name: str(path.resolve()) for name, path in paths.items() if path is not None}
    page = NodeProcess(PAGE_NODE, {"address": address, "port": port, **given})
    check_free(join_names(namespace, (page.name,)))
    nodes = RunningNodes(sys.stdout, on_page=show_page)
    nodes.stop_by_signals()
    if nodes.run((page,), namespace, "the page is up; Ctrl-C ends it, not the rig"):
        raise RigError("the page has ended: see above")
