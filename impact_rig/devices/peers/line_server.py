"""A TCP server on loopback that answers lines, and can vanish as if its cable was pulled."""

import contextlib
import socket
import struct
import threading
from collections.abc import Callable

HOST = "127.0.0.1"
LONGEST_LINE = 65_536
"""Bytes; who sends more without an end of line is thrown out."""
ABORT = struct.pack("ii", 1, 0)
"""SO_LINGER: a connection that is closed is gone at once."""

Taker = Callable[[bytes], tuple[bytes, bool]]
"""Takes a line without its end; returns what to send back, and whether the connection goes on."""


class LineServer:
    """Serves any number of connections, each in a thread.

    Parameters
    ----------
    take : callable
        Answers a line; called by several threads.
    port : int
        To listen on; 0: any that is free, and the same one ever after.

    Attributes
    ----------
    is_busy : bool
        Every connection is closed as soon as it is made.
    """

    def __init__(self, take: Taker, port: int = 0) -> None:
        self.is_busy = False
        self._take = take
        self._port = port
        self._lock = threading.Lock()
        self._listener: socket.socket | None = None
        self._connections: set[socket.socket] = set()
        self._threads: list[threading.Thread] = []

    @property
    def address(self) -> str:
        """Host and port."""
        return f"{HOST}:{self._port}"

    def open(self) -> None:
        """Listen; nothing happens if it does already."""
        if self._listener is not None:
            return
        listener = socket.create_server((HOST, self._port))
        self._port = listener.getsockname()[1]
        self._listener = listener
        self._run(self._accept, listener)

    def close(self) -> None:
        """Close listener and connections, and return when nobody can reach anything any more."""
        with self._lock:
            listener, self._listener = self._listener, None
            connections = list(self._connections)
        if listener is not None:
            # Closing alone does not wake who waits in accept or recv.
            with contextlib.suppress(OSError):
                listener.shutdown(socket.SHUT_RDWR)
            listener.close()
        for connection in connections:
            with contextlib.suppress(OSError):
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, ABORT)
                connection.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        self._threads.clear()

    def _run(self, target: Callable[[socket.socket], None], argument: socket.socket) -> None:
        thread = threading.Thread(target=target, args=(argument,), daemon=True)
        self._threads.append(thread)
        thread.start()

    def _accept(self, listener: socket.socket) -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            with self._lock:
                is_open = self._listener is listener and not self.is_busy
                if is_open:
                    self._connections.add(connection)
            if is_open:
                self._run(self._serve, connection)
            else:
                connection.close()

    def _serve(self, connection: socket.socket) -> None:
        with contextlib.suppress(OSError):
            self._answer_lines(connection)
        with self._lock:
            self._connections.discard(connection)
        connection.close()

    def _answer_lines(self, connection: socket.socket) -> None:
        """Answer until the other side or we have enough."""
        waiting = b""
        while len(waiting) < LONGEST_LINE and (data := connection.recv(4096)):
            *lines, waiting = (waiting + data).split(b"\n")
            for line in lines:
                answer, goes_on = self._take(line)
                if answer:
                    connection.sendall(answer)
                if not goes_on:
                    return
