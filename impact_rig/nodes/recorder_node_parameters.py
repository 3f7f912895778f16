"""The parameters of all nodes of a rig, asked for without waiting and kept as text."""

from collections.abc import Callable

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.parameter import parameter_value_to_python

from impact_rig.core.errors import DeviceError
from impact_rig.nodes.rig_node import OWN_NODES, RigNode
from impact_rig.recordings.provenance import format_parameters

ANSWER_TIMEOUT = 3.0
"""How long an answer is waited for until a node is asked again [s], our choice."""
LISTER = "/list_parameters"
"""Behind a node's name: the service by which it tells of what parameters it has."""


class NodeParameters:
    """Keeps the parameters of every node below the namespace of one of them.

    Parameters
    ----------
    node : RigNode
        Whose namespace it is; it asks.
    changed : callable
        Called with all texts, by full node name, when something is new and nobody's first answer
        is expected any more.
    """

    def __init__(self, node: RigNode, changed: Callable[[dict[str, str]], None]) -> None:
        self._node = node
        self._changed = changed
        self._texts: dict[str, str] = {}
        self._told: dict[str, str] = {}
        self._asked: set[str] = set()
        self._silent: set[str] = set()
        self._outdated: set[str] = set()
        self._is_closed = False

    def look(self) -> None:
        """Ask nodes of the rig that have appeared, and tell what they said; call it now and then.

        Other nodes in its namespace, as each `ros2` command line is one, may never answer.
        """
        prefix = self._node.get_namespace().rstrip("/") + "/"
        own = {prefix + name for name in OWN_NODES}
        for service, _ in self._node.get_service_names_and_types():
            full_name = service.removesuffix(LISTER)
            is_known = full_name in self._texts and full_name not in self._outdated
            is_new = not is_known and full_name not in self._asked
            if is_new and service.endswith(LISTER) and full_name in own:
                self._asked.add(full_name)
                self._node.executor.create_task(self._ask, full_name)
        if self._asked <= self._silent:
            self._tell()

    def note_change(self, full_name: str) -> None:
        """Ask a node again: one of its parameters was set."""
        self._outdated.add(full_name)

    def close(self) -> None:
        """Tell what is known, and ask nobody any more."""
        self._tell()
        self._is_closed = True

    async def _ask(self, full_name: str) -> None:
        self._outdated.discard(full_name)
        node = self._node
        lister = node.create_client(ListParameters, full_name + LISTER)
        getter = node.create_client(GetParameters, f"{full_name}/get_parameters")
        try:
            listed = await node.call(
                lister, ListParameters.Request(), ANSWER_TIMEOUT, lambda: self._is_closed
            )
            request = GetParameters.Request(names=sorted(listed.result.names))
            values = (
                await node.call(getter, request, ANSWER_TIMEOUT, lambda: self._is_closed)
            ).values
            # One that was taken back meanwhile has no value.
            found = dict(zip(request.names, map(parameter_value_to_python, values), strict=False))
            self._texts[full_name] = format_parameters(found)
            self._silent.discard(full_name)
        except DeviceError:
            self._silent.add(full_name)
        finally:
            self._asked.discard(full_name)
            # Clients that are not needed would only cost the executor time.
            node.destroy_client(lister)
            node.destroy_client(getter)

    def _tell(self) -> None:
        if self._texts != self._told:
            self._told = dict(self._texts)
            self._changed(self._told)
