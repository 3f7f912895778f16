"""Viewers of our own, a window and a web page, fed through a relay that keeps what was shown.

Viewers close and come back, as many as there are: the relay, in this process, gives each all that
it has. One that is stuck holds up the others: Rerun waits for it.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from impact_rig.present.rerun import addresses
from impact_rig.present.rerun.destination import (
    CLOSE_TIMEOUT,
    DestinationPlan,
    Notice,
    StreamDestination,
)
from impact_rig.present.rerun.viewer_program import start_server, start_viewer, stop_server

if TYPE_CHECKING:
    import rerun as rr

LOOK_PERIOD = 0.05
"""How often it is looked whether the page is up [s], our choice."""
RELAY_MEMORY = "512MiB"
"""What is kept for a viewer that comes late, our choice: 4000 hits."""


class Relay(StreamDestination):
    """A destination that any number of viewers look at.

    Parameters
    ----------
    sdk : module
        `rerun`.
    stream : rerun.RecordingStream
        Logging goes there; its sinks are set here.
    plan : DestinationPlan
        Where relay and page listen, and whether to open a window and to serve a page.
    refresh_period : float
        Least time between two versions of what is replaced as a whole [s].
    announce, notify : callable
        Told in one sentence where the page is, and that viewers are shown everything again; what
        is lost, and that the window was closed.

    Raises
    ------
    DeviceError
        If it cannot be listened there.
    RigError
        If the viewer's program is not installed.
    """

    def __init__(
        self,
        sdk: Any,
        stream: rr.RecordingStream,
        plan: DestinationPlan,
        refresh_period: float,
        *,
        announce: Notice,
        notify: Notice,
    ) -> None:
        port = addresses.choose_port(plan.listen, plan.relay_port)
        page_port = addresses.choose_port(plan.listen, plan.web_port) if plan.web else 0
        # Any web site could have its visitors' browsers read a relay that let all pages in.
        origins = [] if addresses.is_local(plan.listen) else [f"http://*:{page_port}"]
        server = sdk.GrpcServerSink(
            plan.listen, port, server_memory_limit=RELAY_MEMORY, cors_allow_origin=origins
        )
        stream.set_sinks(server)
        host = addresses.choose_reachable_name(plan.listen)
        address = addresses.make_viewer_address(host, port)
        self._page: WebPage | None = None
        self._is_held_up = False
        self._announce = announce
        super().__init__(f"the relay {address}", stream, refresh_period, notify)
        if plan.web:
            self._page = WebPage(
                plan.listen, page_port, address, [address], announce=announce, notify=notify
            )
        if plan.spawn:
            host = addresses.choose_loopback(plan.listen)
            _open_window(addresses.make_viewer_address(host, port), notify)

    @property
    def is_lost(self) -> bool:
        """Whether nothing can be shown now; what a viewer holds up is shown when it lets go."""
        return self._is_held_up or super().is_lost

    def close(self, timeout: float = CLOSE_TIMEOUT) -> None:
        """Log what is queued, and serve no longer; a viewer keeps what it has."""
        super().close(timeout)
        if self._page is not None:
            self._page.close()
            self._page = None

    def _flush(self) -> None:
        """Wait as long as a viewer is stuck; who puts something never does."""
        while True:
            try:
                super()._flush()
            except RuntimeError:
                if self._is_closing:
                    raise
                self._hold_up()
            else:
                break
        if self._is_held_up:
            self._is_held_up = False
            self._announce(f"{self.name} goes on")

    def _hold_up(self) -> None:
        if not self._is_held_up:
            self._is_held_up = True
            self._notify(
                f"{self.name} is held up by a viewer that takes no data: the rig goes on, and the"
                " view when that viewer goes on or is closed"
            )


def _open_window(relay: str, notify: Notice) -> None:
    """Open a viewer that shows what the relay has; `notify` is told when it was closed."""
    # Nobody connects to the window's own server, which it will not do without.
    command = ["--connect", relay, "--bind", addresses.LOOPBACK, "--port", "auto"]
    viewer = start_viewer(command)

    def watch() -> None:
        code = viewer.wait()
        notify(f"the viewer has ended (exit code {code}): rerun {' '.join(command)} opens another")

    threading.Thread(target=watch, name="viewer", daemon=True).start()


class WebPage:
    """Serves a viewer as a web page until it is closed, or this process ends.

    Parameters
    ----------
    listen : str
        IP address that is listened on.
    port : int
        That is listened on.
    relay : str
        Address of what the page shows, as a browser finds it.
    arguments : sequence of str
        Further ones for Rerun's command line: files to be shown, or the relay.
    announce : callable
        Told in one sentence, from another thread, where the page is, once it is.
    notify : callable
        Told in one sentence, from another thread, that the page is there no longer.

    Raises
    ------
    RigError
        If the viewer's program is not installed.
    """

    def __init__(
        self,
        listen: str,
        port: int,
        relay: str,
        arguments: Sequence[str],
        *,
        announce: Notice,
        notify: Notice,
    ) -> None:
        self.address = addresses.make_page_address(
            addresses.choose_reachable_name(listen), port, relay
        )
        self._local = addresses.choose_loopback(listen), port
        self._announce = announce
        self._notify = notify
        self._closing = threading.Event()
        self._server = start_server(
            ["--serve-web", "--bind", listen, "--web-viewer-port", str(port), *arguments]
        )
        self._thread = threading.Thread(target=self._watch, name="web page", daemon=True)
        self._thread.start()

    def wait(self) -> None:
        """Wait until the page is there no longer."""
        self._thread.join()

    def close(self) -> None:
        """Serve no longer; a browser keeps what it has."""
        self._closing.set()
        stop_server(self._server)
        self._thread.join()

    def _watch(self) -> None:
        while self._server.poll() is None and not addresses.is_answering(*self._local):
            self._closing.wait(LOOK_PERIOD)
        if self._server.poll() is None:
            self._announce(f"the view is at {self.address}")
        code = self._server.wait()
        if not self._closing.is_set():
            self._notify(f"the web page at {self.address} has ended (exit code {code})")
