"""A TCP connection to an instrument: commands, and answers that come in time or not at all."""

import contextlib
import re
import socket
import time

from impact_rig.core.errors import DeviceError, ParameterError

END = b"\r\n"
"""Of a command: SCPI takes the carriage return for white space where only a newline is meant."""
LONGEST_TEXT = 4096
"""Bytes of an answer that is a word or a number, our choice."""
CHUNK = 65_536
"""Bytes that are asked of the socket at once."""
SHOWN = 40
"""Characters of an answer that a message shows, our choice."""
_ADDRESS = re.compile(r"(?:\[(?P<six>[^\]]+)\]|(?P<host>[^:\s]+))(?::(?P<port>\d{1,5}))?")


def parse_address(text: str, default_port: int) -> tuple[str, int]:
    """Return host and port of an address like "192.168.1.20:5000" or "[fe80::1]:5000".

    Raises
    ------
    ParameterError
        If it is none.
    """
    match = _ADDRESS.fullmatch(text)
    port = int(match["port"] or default_port) if match else 0
    if match is None or not 0 < port < 2**16:
        raise ParameterError(
            f"address is {text!r}: it must be a host and a port, like 192.168.1.20:{default_port}"
        )
    return match["six"] or match["host"], port


class ScpiConnection:
    """Says commands, and returns what is answered.

    Whatever goes wrong is a `DeviceError`; after one the connection is of no more use.

    Parameters
    ----------
    host : str
        Name or number.
    port : int
        Of TCP.
    timeout : float
        That a connection, and each answer as a whole, may take [s].

    Raises
    ------
    DeviceError
        If nobody is there.
    """

    def __init__(self, host: str, port: int, timeout: float) -> None:
        self._name = f"the SCPI instrument at {host}:{port}"
        self._timeout = timeout
        self._buffer = bytearray()
        self._has_answered = self._is_answering = False
        try:
            self._socket = socket.create_connection((host, port), timeout)
        except TimeoutError:
            raise DeviceError(
                f"{self._name} does not answer within {timeout:g} s: check address, cable and"
                " power"
            ) from None
        except ConnectionRefusedError:
            raise DeviceError(
                f"{self._name} refuses connections: start its SCPI server, and check the port"
            ) from None
        except (OSError, UnicodeError) as error:
            raise DeviceError(f"{self._name} cannot be reached: {_describe(error)}") from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def close(self) -> None:
        """Hang up, whatever the other side does."""
        with contextlib.suppress(OSError):
            self._socket.close()

    def send(self, command: str) -> None:
        """Say a command that has no answer.

        Raises
        ------
        DeviceError
            If the instrument is gone.
        """
        self._socket.settimeout(self._timeout)
        try:
            self._socket.sendall(command.encode() + END)
        except TimeoutError:
            raise DeviceError(f"{self._name} takes no more commands: restart it") from None
        except OSError as error:
            raise self._make_loss_error(error) from None

    def ask(self, query: str, longest: int = LONGEST_TEXT) -> str:
        """Return the answer to a query: a line of text, without its end.

        Raises
        ------
        DeviceError
            If the instrument is gone or silent, answers half a line, more than `longest` bytes, or
            what is no text.
        """
        deadline = self._say(query)
        while (end := self._buffer.find(b"\n")) < 0:
            if len(self._buffer) > longest:
                raise self.make_nonsense_error(query, bytes(self._buffer), "a line of text")
            self._receive(query, deadline)
        line = bytes(self._buffer[:end])
        del self._buffer[: end + 1]
        self._is_answering = False
        text = line.decode("latin-1").strip()
        if not (text.isascii() and text.isprintable()):
            raise self.make_nonsense_error(query, line, "a line of text")
        self._has_answered = True
        return text

    def ask_block(self, query: str, longest: int) -> bytes:
        """Return the answer to a query: a definite-length block of IEEE 488.2.

        Such a block is ``#``, the number of digits of its length, its length, its bytes.

        Raises
        ------
        DeviceError
            If the instrument is gone or silent, sends half a block, more than `longest` bytes, or
            something else.
        """
        deadline = self._say(query)
        begin = self._read(2, query, deadline)
        digits = int(begin[1:]) if begin[1:].isdigit() else 0
        wanted = "a block of bytes"
        if begin[:1] != b"#" or not digits:
            raise self.make_nonsense_error(query, begin + bytes(self._buffer), wanted)
        length = self._read(digits, query, deadline)
        if not length.isdigit() or int(length) > longest:
            wanted = f"a block of {longest} bytes at most"
            raise self.make_nonsense_error(query, begin + length, wanted)
        data = self._read(int(length), query, deadline)
        if (end := self._read(1, query, deadline)) == b"\r":
            end = self._read(1, query, deadline)
        if end != b"\n":
            raise self.make_nonsense_error(query, end, "the end of the block")
        self._is_answering = False
        return data

    def wait(self, seconds: float) -> None:
        """Wait while nothing is asked.

        Raises
        ------
        DeviceError
            If the instrument goes away, or says something by itself.
        """
        self._socket.settimeout(max(seconds, 1e-3))
        try:
            data = self._socket.recv(CHUNK)
        except TimeoutError:
            return
        except OSError as error:
            raise self._make_loss_error(error) from None
        if not data:
            raise self._make_loss_error(None)
        raise self.make_nonsense_error("nothing", data, "silence")

    def make_nonsense_error(self, query: str, answer: bytes | str, wanted: str) -> DeviceError:
        """Return the error that an answer makes no sense: it should be what is `wanted`."""
        shown = repr(answer[:SHOWN]).removeprefix("b")
        more = " ..." if len(answer) > SHOWN else ""
        return DeviceError(
            f"{self._name} answers {shown}{more} to {query}: {wanted} should come; is it the right"
            " instrument, and does nobody else talk to it?"
        )

    def make_error(self, text: str) -> DeviceError:
        """Return an error whose sentence begins with the instrument."""
        return DeviceError(f"{self._name} {text}")

    def _say(self, query: str) -> float:
        """Send a query, and return until when its answer must be there."""
        if self._buffer:
            raise self.make_nonsense_error("nothing", bytes(self._buffer), "silence")
        self.send(query)
        self._is_answering = False
        return time.monotonic() + self._timeout

    def _read(self, count: int, query: str, deadline: float) -> bytes:
        while len(self._buffer) < count:
            self._receive(query, deadline)
        data = bytes(self._buffer[:count])
        del self._buffer[:count]
        return data

    def _receive(self, query: str, deadline: float) -> None:
        """Take what comes next."""
        left = deadline - time.monotonic()
        try:
            if left <= 0.0:
                raise TimeoutError
            self._socket.settimeout(left)
            data = self._socket.recv(CHUNK)
        except TimeoutError:
            if self._is_answering:
                raise self.make_error(
                    f"has sent half of its answer to {query}, and nothing more within"
                    f" {self._timeout:g} s: check its network"
                ) from None
            raise self.make_error(
                f"does not answer {query} within {self._timeout:g} s: is it the right instrument,"
                " and does it still work?"
            ) from None
        except OSError as error:
            raise self._make_loss_error(error) from None
        if not data:
            raise self._make_loss_error(None)
        self._buffer += data
        self._is_answering = True

    def _make_loss_error(self, error: OSError | None) -> DeviceError:
        reason = f": {_describe(error)}" if error is not None else ""
        if not self._has_answered:
            return self.make_error(
                f"closes the connection at once{reason}: another program may hold it"
            )
        middle = " in the middle of its answer" if self._is_answering else ""
        return self.make_error(
            f"has closed the connection{middle}{reason}: check its cable and power"
        )


def _describe(error: Exception) -> str:
    """Return what went wrong, as the system says it."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror[:1].lower() + error.strerror[1:]
    return str(error) or type(error).__name__
