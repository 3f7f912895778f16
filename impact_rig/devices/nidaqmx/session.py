"""Where NI-DAQmx is: on this computer, or on another one that runs NI's gRPC device server."""

import os
import re
import socket
from typing import TYPE_CHECKING, Any

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.errors import RigError
from impact_rig.devices.nidaqmx.errors import report_errors

if TYPE_CHECKING:
    from nidaqmx import Task
    from nidaqmx.system import System

_ADDRESS = re.compile(r"(?P<host>\[[0-9a-fA-F:.]+\]|[^\s:/\[\]]+):(?P<port>\d{1,5})")
HIGHEST_PORT = 65535
_CHANNEL_OPTIONS = (
    # A server that comes back is seen at once: no memory of failures shared with old channels.
    ("grpc.use_local_subchannel_pool", 1),
    # It is on the laboratory's own network.
    ("grpc.enable_http_proxy", 0),
    ("grpc.max_receive_message_length", -1),
)


def take_server(options: TomlTable) -> str:
    """Return "host:port" of NI's gRPC device server, empty for this computer.

    Raises
    ------
    ParameterError
        If it is no such text.
    """
    server = options.take_text("server")
    match = _ADDRESS.fullmatch(server)
    if server and not (match and 0 < int(match["port"]) <= HIGHEST_PORT):
        raise options.refuse("server", 'host and port of NI\'s server, like "192.168.1.30:31763"')
    return server


class Session:
    """A connection to NI-DAQmx, and at most one task there.

    Parameters
    ----------
    subject : str
        What the task is of, for messages: "NI device Dev1".
    server : str
        "host:port" of a gRPC device server; empty: NI-DAQmx of this computer.
    patience : float
        Longest time for an answer of the server, beyond what a call itself waits [s].
    """

    def __init__(self, subject: str, server: str, patience: float) -> None:
        self.subject = f"{subject} at {server}" if server else subject
        self._server = server
        self._patience = patience
        self._channel: Any = None
        self._task: Any = None

    def find_system(self) -> "System":
        """Return the devices' names and what they are."""
        from nidaqmx.system import System

        return System(self._make_options("") if self._server else None)

    def open_task(self, purpose: str) -> "Task":
        """Return a new task.

        Sessions of a server outlive their connection: a task of this process for the same purpose
        that a lost connection has left behind still holds the device, and is ended first.

        Parameters
        ----------
        purpose : str
            Different for each device and kind of task.
        """
        from nidaqmx import Task

        if not self._server:
            self._task = Task()
            return self._task
        owner = f"impact_rig_{socket.gethostname()}_{os.getpid()}_{purpose}"
        name = re.sub(r"\W", "_", owner)
        self._task = Task(name, grpc_options=self._make_options(name))
        if self._task.number_of_channels > 0:
            self._task.close()
            self._task = Task(name, grpc_options=self._make_options(name))
        return self._task

    def close(self) -> None:
        """End the task and the connection; never raises, safe to call twice."""
        task, self._task = self._task, None
        channel, self._channel = self._channel, None
        if task is not None:
            try:
                with report_errors(self.subject):
                    task.close()
            except RigError:
                # The device is gone: there is nothing left to end.
                pass
        if channel is not None:
            channel.close()

    def _make_options(self, name: str) -> Any:
        from nidaqmx import GrpcSessionOptions

        if self._channel is None:
            self._channel = _open_channel(self._server, self._patience)
        return GrpcSessionOptions(self._channel, name)


def _open_channel(server: str, patience: float) -> Any:
    """Return a gRPC channel all of whose calls end in time."""
    import grpc

    class Deadline(grpc.UnaryUnaryClientInterceptor):
        """Gives each call the time that it waits itself, and the server's patience."""

        def intercept_unary_unary(self, continuation: Any, details: Any, request: Any) -> Any:
            waits = getattr(request, "timeout", 0.0) or getattr(request, "time_to_wait", 0.0)
            return continuation(details._replace(timeout=waits + patience), request)

    return grpc.intercept_channel(
        grpc.insecure_channel(server, options=_CHANNEL_OPTIONS), Deadline()
    )
