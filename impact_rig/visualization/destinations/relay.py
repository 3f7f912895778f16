"""Viewers of our own, a window and a web page, fed through a relay that keeps what was shown.

Viewers close and come back, as many as there are: the relay, in this process, gives each all that
it has. One that is stuck holds up the others: Rerun waits for it.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

from impact_rig.visualization.destinations import addresses
from impact_rig.visualization.destinations.destination import (
    CLOSE_TIMEOUT,
    Notice,
    StreamDestination,
)
from impact_rig.visualization.destinations.program import start_viewer
from impact_rig.visualization.destinations.web_page import WebPage

if TYPE_CHECKING:
    import rerun as rr

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
    listen : str
        IP address that relay and page listen on.
    port, page_port : int
        Of relay and page; 0: any free one.
    has_window, has_page : bool
        Open a viewer's window on this host; serve a page with a viewer for browsers.
    refresh_period, notify
        As `StreamDestination` takes them; `notify` is also told when the window was closed.
    announce : callable
        Told in one sentence where the page is, and that viewers are shown everything again.

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
        *,
        listen: str,
        port: int,
        page_port: int,
        has_window: bool,
        has_page: bool,
        refresh_period: float,
        notify: Notice,
        announce: Notice,
    ) -> None:
        port = addresses.find_port(listen, port)
        page_port = addresses.find_port(listen, page_port) if has_page else 0
        # Any web site could have its visitors' browsers read a relay that let all pages in.
        origins = [] if addresses.is_local(listen) else [f"http://*:{page_port}"]
        stream.set_sinks(
            sdk.GrpcServerSink(
                listen, port, server_memory_limit=RELAY_MEMORY, cors_allow_origin=origins
            )
        )
        address = addresses.make_viewer_address(addresses.find_reachable_name(listen), port)
        self._page: WebPage | None = None
        self._is_held_up = False
        self._announce = announce
        super().__init__(f"the relay {address}", stream, refresh_period, notify)
        if has_page:
            self._page = WebPage(
                listen, page_port, address, [address], announce=announce, notify=notify
            )
        if has_window:
            local = addresses.make_viewer_address(addresses.find_loopback(listen), port)
            _open_window(local, notify)

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
