"""The parameters of all nodes of a rig, kept as text."""

from collections.abc import Callable

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.parameter import parameter_value_to_python

from impact_rig.core.errors import DeviceError
from impact_rig.nodes.rig_node import RigNode
from impact_rig.recordings.provenance import format_parameters

ANSWER_TIMEOUT = 3.0
"""How long an answer may take until a node is asked again [s], our choice."""
NODES = (
    "accelerometer", "campaign", "estimator", "hammer", "recorder", "replayer", "visualizer"
)  # fmt: skip
LISTER = "/list_parameters"
"""Ends the name of the service by which a node lists its parameters."""


class NodeParameters:
    """Asks the rig's nodes in a node's namespace for their parameters.

    `on_change` is called with all texts, by full node name, when one of them has changed.
    """

    def __init__(self, node: RigNode, on_change: Callable[[dict[str, str]], None]) -> None:
        self._node = node
        self._on_change = on_change
        self._texts: dict[str, str] = {}
        self._asked: set[str] = set()

    def ask_new_nodes(self) -> None:
        """Ask nodes of the rig that have not been asked; others may never answer."""
        prefix = self._node.get_namespace().rstrip("/") + "/"
        services = {name for name, _ in self._node.get_service_names_and_types()}
        for full_name in (prefix + name for name in NODES):
            if full_name + LISTER in services and full_name not in self._asked:
                self._asked.add(full_name)
                self._node.executor.create_task(self._ask, full_name)

    def ask_again(self, full_name: str) -> None:
        """Ask a node again, since one of its parameters was set."""
        self._asked.discard(full_name)

    async def _ask(self, full_name: str) -> None:
        node = self._node
        lister = node.create_client(ListParameters, full_name + LISTER)
        getter = node.create_client(GetParameters, f"{full_name}/get_parameters")
        try:
            listed = await node.call(lister, ListParameters.Request(), ANSWER_TIMEOUT)
            names = sorted(listed.result.names)
            got = await node.call(getter, GetParameters.Request(names=names), ANSWER_TIMEOUT)
        except DeviceError:
            self._asked.discard(full_name)
            return
        finally:
            # Idle clients would cost the executor time.
            node.destroy_client(lister)
            node.destroy_client(getter)
        # One that was undeclared meanwhile has no value.
        found = dict(zip(names, map(parameter_value_to_python, got.values), strict=False))
        text = format_parameters(found)
        if self._texts.get(full_name) != text:
            self._texts[full_name] = text
            self._on_change(dict(self._texts))
