"""A page with a viewer for browsers, served by Rerun's own program."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from impact_rig.visualization.destinations.addresses import (
    find_loopback,
    find_reachable_name,
    is_answering,
    make_page_address,
)
from impact_rig.visualization.destinations.destination import Notice
from impact_rig.visualization.destinations.program import start_server, stop_server

LOOK_PERIOD = 0.05
"""How often it is looked whether the page is up [s], our choice."""


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
        self.address = make_page_address(find_reachable_name(listen), port, relay)
        self._local = find_loopback(listen), port
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
        while self._server.poll() is None and not is_answering(*self._local):
            self._closing.wait(LOOK_PERIOD)
        if self._server.poll() is None:
            self._announce(f"the view is at {self.address}")
        code = self._server.wait()
        if not self._closing.is_set():
            self._notify(f"the web page at {self.address} has ended (exit code {code})")
