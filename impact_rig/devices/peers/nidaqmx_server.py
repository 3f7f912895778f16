"""A server that speaks the protocol of NI's gRPC device server, with a simulated device behind.

It is no NI software. It is written from the published protocol (`nidaqmx.proto`, as the Python
package `nidaqmx` carries it) and NI's manual, to try the drivers without NI's driver and without
a device. What it knows is what the drivers need: sessions that outlive a connection, reservation,
accelerometers, IEPE force sensors and voltages by their sensitivities, a 16-bit converter with
three ranges, a sample clock that is a whole part of 100 MHz, a reference trigger with pre-trigger
on the level of a channel, continuous acquisition with a buffer that overflows, overload, one
static output line for each task, and errors by NI's numbers. It does not simulate excitation and
coupling (both are checked or taken, without effect), triggers at a terminal, filters, the delay
of the converters, and noise of its own.
"""

import argparse
import json
import socket
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, Self

from impact_rig.devices.peers.nidaqmx_attributes import Fields
from impact_rig.devices.peers.nidaqmx_device import DaqmxError, SimulatedDevice
from impact_rig.devices.peers.nidaqmx_service import DaqmxService

if TYPE_CHECKING:
    from impact_rig.devices.virtual.rig import VirtualHit

SENSITIVITY = 0.010 / 9.80665
"""10 mV/g, of both sensors when the server is a process of its own [V per m/s^2]."""
HOST = "127.0.0.1"
WORKERS = 4
"""Calls at one time."""


class NidaqmxServer:
    """The server, in threads of this process.

    Parameters
    ----------
    hammer_sensitivity, specimen_sensitivity : float
        Of the sensors that are plugged in [V per m/s^2], signed.

    Attributes
    ----------
    device : SimulatedDevice
        Behind the server.
    errors : dict
        Calls that fail: their names, and the number of the error.
    silent : set of str
        Calls that are never answered and do nothing, by their names.
    spoiled : dict
        Calls whose answers are changed: their names, and what to make of the answer's fields.
    calls : list of str
        Names of all calls so far.
    """

    def __init__(self, hammer_sensitivity: float, specimen_sensitivity: float) -> None:
        self.device = SimulatedDevice((hammer_sensitivity, specimen_sensitivity))
        self.errors: dict[str, int] = {}
        self.silent: set[str] = set()
        self.spoiled: dict[str, Callable[[Fields], Fields]] = {}
        self.calls: list[str] = []
        self._service = DaqmxService(self.device)
        self._unplugged = threading.Event()
        self._place: socket.socket | None = None
        self._server: Any = None

    def __enter__(self) -> Self:
        """Start."""
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop."""
        self.stop()

    @property
    def address(self) -> str:
        """Where it listens, or did: "host:port"."""
        port = self._place.getsockname()[1] if self._place is not None else 0
        return f"{HOST}:{port}"

    def start(self) -> None:
        """Take a free port of this computer, and listen."""
        # A socket that never listens keeps the port ours while the server is away.
        self._place = socket.socket()
        self._place.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        self._place.bind((HOST, 0))
        self.plug()

    def feed(self, hit: "VirtualHit") -> None:
        """Let the hammer strike now."""
        self.device.feed(hit)

    def plug(self) -> None:
        """Listen again on the same port; sessions are as they were."""
        import grpc

        self._unplugged.clear()
        self._server = grpc.server(ThreadPoolExecutor(WORKERS), options=[("grpc.so_reuseport", 1)])
        self._server.add_generic_rpc_handlers((self._make_handlers(),))
        self._server.add_insecure_port(self.address)
        self._server.start()

    def unplug(self) -> None:
        """Close the port and all connections, as if the network cable was pulled."""
        self._unplugged.set()
        with self.device.changed:
            self.device.changed.notify_all()
        if self._server is not None:
            self._server.stop(0).wait()
            self._server = None

    def stop(self) -> None:
        """Close everything."""
        self.unplug()
        if self._place is not None:
            self._place.close()

    def _make_handlers(self) -> Any:
        """Return a handler for each method of the service."""
        import grpc
        from google.protobuf.message_factory import (  # type: ignore[import-untyped]
            GetMessageClass,
        )
        from nidaqmx._stubs import nidaqmx_pb2

        description = nidaqmx_pb2.DESCRIPTOR.services_by_name["NiDAQmx"]
        handlers = {
            method.name: grpc.unary_unary_rpc_method_handler(
                self._make_behavior(
                    method.name,
                    getattr(self._service, method.name),
                    GetMessageClass(method.output_type),
                ),
                request_deserializer=GetMessageClass(method.input_type).FromString,
                response_serializer=GetMessageClass(method.output_type).SerializeToString,
            )
            for method in description.methods
            if hasattr(self._service, method.name)
        }
        return grpc.method_handlers_generic_handler(description.full_name, handlers)

    def _make_behavior(
        self, name: str, call: Callable[[Any], Fields], answer: Any
    ) -> Callable[[Any, Any], Any]:
        """Return what the server does when a method is called."""
        import grpc

        def behave(request: Any, context: Any) -> Any:
            self.calls.append(name)
            if name in self.silent:
                self._stay_silent(context)
                context.abort(grpc.StatusCode.CANCELLED, "nobody waits for this any more")
            try:
                if name in self.errors:
                    raise DaqmxError(self.errors[name], "It fails because a test wants it.")
                with self.device.changed:
                    fields = call(request)
                return answer(**self.spoiled.get(name, dict)(fields))
            except DaqmxError as error:
                # As NI's server tells an error: its number in the trailing metadata.
                context.set_trailing_metadata((("ni-error", str(error.code)),))
                context.abort(grpc.StatusCode.UNKNOWN, str(error))

        return behave

    def _stay_silent(self, context: Any) -> None:
        """Return when the caller has given up, or the server is unplugged."""
        given_up = threading.Event()
        context.add_callback(given_up.set)
        while not given_up.wait(0.01) and not self._unplugged.is_set():
            pass


def main() -> None:
    """Do what standard input says until it ends: strike, unplug, plug, quit."""
    from impact_rig.core.setup.paper import CONTROL_SAMPLE, PAPER_SETUP
    from impact_rig.core.signals.record import HitLabel
    from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings

    parser = argparse.ArgumentParser(description="A digitizer behind NI's protocol that is none.")
    parser.add_argument("--sample", default=CONTROL_SAMPLE, help="that is struck")
    parser.add_argument("--seed", type=int, default=1, help="of the hits' scatter")
    arguments = parser.parse_args()
    rig = VirtualRig(PAPER_SETUP, VirtualRigSettings(seed=arguments.seed))
    impact = 0
    with NidaqmxServer(SENSITIVITY, SENSITIVITY) as server:
        print(json.dumps({"address": server.address}), flush=True)
        for line in sys.stdin:
            match line.strip():
                case "strike":
                    impact += 1
                    server.feed(rig.strike(HitLabel(arguments.sample, impact=impact)))
                case "unplug":
                    server.unplug()
                case "plug":
                    server.plug()
                case "quit":
                    break


if __name__ == "__main__":
    main()
