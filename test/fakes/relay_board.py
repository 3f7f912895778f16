"""A USB relay board that is not there: it listens at the other end of a pseudo-terminal."""

import os
import select
import tempfile
import threading
import tty
from collections.abc import Callable
from pathlib import Path

FRAMES = {bytes.fromhex("a00101a2"): True, bytes.fromhex("a00100a1"): False}
"""What switches relay 1 on and off, by the boards' manual."""


class RelayBoard:
    """A board with one relay, which speaks the four-byte protocol; it is not plugged in yet.

    Parameters
    ----------
    on_release : callable
        Called, in a thread of the board's own, when the relay releases the hammer.
    holds_on : bool
        The relay holds while it is on, else while it is off. Unplugged, it is off.
    """

    def __init__(
        self, on_release: Callable[[], None] = lambda: None, *, holds_on: bool = False
    ) -> None:
        self._on_release = on_release
        self._holds_on = holds_on
        self._is_on = False
        self._folder = tempfile.TemporaryDirectory(prefix="impact_rig_relay_")
        self.port = str(Path(self._folder.name, "relay"))  # the same after every `plug`
        self._wake = -1
        self._thread: threading.Thread | None = None

    @property
    def is_holding(self) -> bool:
        """Whether the hammer is held."""
        return self._is_on == self._holds_on

    def stop(self) -> None:
        """Disappear for good."""
        self.unplug()
        self._folder.cleanup()

    def plug(self) -> None:
        """Be plugged in: another pseudo-terminal under the same path; the relay is off."""
        board, port = os.openpty()
        tty.setraw(port)
        reader, self._wake = os.pipe()
        self._thread = threading.Thread(target=self._serve, args=(board, port, reader))
        self._thread.start()
        Path(self.port).symlink_to(os.ttyname(port))

    def unplug(self) -> None:
        """Be pulled out: the port is gone, and the relay off; nothing happens if it is out."""
        if self._thread is None:
            return
        Path(self.port).unlink()
        os.close(self._wake)
        self._thread.join()
        self._thread = None
        self._switch(is_on=False)

    def _serve(self, board: int, port: int, reader: int) -> None:
        """Take commands until the wake pipe is closed; the port stays open in between users."""
        received = b""
        while True:
            ready, _, _ = select.select([board, reader], [], [])
            if reader in ready:
                break
            received = self._take(received + os.read(board, 1024))
        for descriptor in (board, port, reader):
            os.close(descriptor)

    def _take(self, received: bytes) -> bytes:
        """Obey what is complete; return the rest."""
        while len(received) >= 4:
            frame, received = received[:4], received[4:]
            if frame in FRAMES:
                self._switch(is_on=FRAMES[frame])
        return received

    def _switch(self, *, is_on: bool) -> None:
        was_holding = self.is_holding
        self._is_on = is_on
        if was_holding and not self.is_holding:
            self._on_release()
