"""The parameters of all nodes of a rig, asked for without waiting and kept as text."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.parameter import parameter_value_to_python

from impact_rig.nodes.rig_node import RigNode
from impact_rig.recordings.provenance import format_parameters

ANSWER_TIMEOUT = 3.0
"""How soon a node that has not answered is asked again [s], our choice."""


@dataclass
class _Inquiry:
    """A node that is being asked; `asked` is when, and None: it must be, first or again."""

    begun: float
    list_client: Any
    get_client: Any
    asked: float | None = None
    is_answered: bool = False


class NodeParameters:
    """Keeps the parameters of every node below the namespace of one of them.

    Parameters
    ----------
    node : RigNode
        Whose namespace it is; it asks.
    changed : callable
        Called with all texts, by full node name, when something is new and nobody's answer is
        expected any more.
    """

    def __init__(self, node: RigNode, changed: Callable[[dict[str, str]], None]) -> None:
        self._node = node
        self._changed = changed
        self._texts: dict[str, str] = {}
        self._told: dict[str, str] = {}
        self._inquiries: dict[str, _Inquiry] = {}

    def look(self) -> None:
        """Ask nodes that have appeared, and tell what they said; call it now and then."""
        prefix = self._node.get_namespace().rstrip("/") + "/"
        for name, namespace in self._node.get_node_names_and_namespaces():
            full_name = f"{namespace.rstrip('/')}/{name}"
            if full_name.startswith(prefix) and full_name not in self._texts:
                self._ask(full_name)
        self._end_answered()
        self._send_requests()
        now = time.monotonic()
        if all(now - inquiry.begun > ANSWER_TIMEOUT for inquiry in self._inquiries.values()):
            self._tell()

    def note_change(self, full_name: str) -> None:
        """Ask a node again, if it was asked before: one of its parameters was set."""
        if full_name in self._inquiries:
            self._inquiries[full_name].asked = None
        elif full_name in self._texts:
            self._ask(full_name)

    def close(self) -> None:
        """Tell what is known, and ask nobody any more."""
        self._tell()
        for inquiry in self._inquiries.values():
            inquiry.is_answered = True
        self._end_answered()

    def _ask(self, full_name: str) -> None:
        if full_name not in self._inquiries:
            self._inquiries[full_name] = _Inquiry(
                time.monotonic(),
                self._node.create_client(ListParameters, f"{full_name}/list_parameters"),
                self._node.create_client(GetParameters, f"{full_name}/get_parameters"),
            )

    def _send_requests(self) -> None:
        now = time.monotonic()
        for full_name, inquiry in self._inquiries.items():
            is_due = inquiry.asked is None or now - inquiry.asked > ANSWER_TIMEOUT
            clients = (inquiry.list_client, inquiry.get_client)
            if is_due and all(client.service_is_ready() for client in clients):
                inquiry.asked = now
                self._ask_names(full_name, inquiry, now)

    def _ask_names(self, full_name: str, inquiry: _Inquiry, asked: float) -> None:
        def ask_values(future: Any) -> None:
            if inquiry.is_answered:
                return
            names = sorted(future.result().result.names)
            answer = inquiry.get_client.call_async(GetParameters.Request(names=names))
            answer.add_done_callback(lambda done: keep(names, done.result().values))

        def keep(names: list[str], values: Sequence[Any]) -> None:
            found = map(parameter_value_to_python, values)
            self._texts[full_name] = format_parameters(dict(zip(names, found, strict=True)))
            inquiry.is_answered = inquiry.asked == asked

        answer = inquiry.list_client.call_async(ListParameters.Request())
        answer.add_done_callback(ask_values)

    def _end_answered(self) -> None:
        """Forget those who answered; their clients would only cost the executor time."""
        for full_name, inquiry in tuple(self._inquiries.items()):
            if inquiry.is_answered:
                del self._inquiries[full_name]
                self._node.destroy_client(inquiry.list_client)
                self._node.destroy_client(inquiry.get_client)

    def _tell(self) -> None:
        if self._texts != self._told:
            self._told = dict(self._texts)
            self._changed(self._told)
