"""A serial port that belongs to us alone, and whose errors say what happened."""

import contextlib
import errno
import os
import termios
from pathlib import Path
from typing import Any

from impact_rig.core.errors import DeviceError
from impact_rig.devices.serial_relay.protocols import FRAME_SIZE, Exchange

SENDING_TIMEOUT = 0.1
ANSWER_TIMEOUT = 0.4
"""How long a request may take to be sent, and an answer to come [s], our choice: a relay needs
20 ms, and no call of a holder may take longer than half a second."""
LONGEST_LINE = 256
"""After so much without the end of a line it is no answer [byte], our choice."""


class RelayPort:
    """A serial port with a relay at its other end.

    Parameters
    ----------
    path : str
        Of the port.
    baud_rate : int
        [bit/s]

    Raises
    ------
    DeviceError
        If it is not there, in other hands, or no serial port.
    ModuleNotFoundError
        If pySerial is not installed.
    """

    def __init__(self, path: str, baud_rate: int) -> None:
        make_port = find_serial_library().Serial
        self._path = path
        try:
            self._serial = make_port(
                path,
                baud_rate,
                timeout=ANSWER_TIMEOUT,
                write_timeout=SENDING_TIMEOUT,
                exclusive=True,
            )
        except (OSError, ValueError, termios.error) as error:
            raise DeviceError(_explain(path, error)) from None

    def send(self, exchange: Exchange, line_end: bytes) -> Any:
        """Send a request and return what its answer means; None if there is none to come.

        Raises
        ------
        DeviceError
            If the port is gone, or the answer is missing, cut short, or none that is known.
        """
        try:
            # What came unasked is no answer.
            self._serial.reset_input_buffer()
            self._serial.write(exchange.request)
            if not exchange.answers:
                return None
            if line_end:
                answer = self._serial.read_until(line_end, LONGEST_LINE)
            else:
                answer = self._serial.read(FRAME_SIZE)
        except (OSError, termios.error) as error:
            raise self._lose(error) from None
        return self._understand(exchange, answer, line_end)

    def check(self) -> None:
        """Look whether the port is still there; raises `DeviceError` if it is not."""
        try:
            _ = self._serial.in_waiting
        except (OSError, termios.error) as error:
            raise self._lose(error) from None

    def close(self) -> None:
        """Let the port go; never raises."""
        with contextlib.suppress(OSError, termios.error):
            self._serial.close()

    def _understand(self, exchange: Exchange, answer: bytes, line_end: bytes) -> Any:
        request = f"the relay at {self._path}, told {_show(exchange.request, line_end)},"
        is_whole = answer.endswith(line_end) if line_end else len(answer) == FRAME_SIZE
        wanted = " or ".join(_show(known, line_end) for known in exchange.answers)
        if not answer:
            raise DeviceError(
                f"{request} did not answer within {ANSWER_TIMEOUT:g} s: it must answer {wanted}"
            )
        line = answer.strip() if line_end else answer
        if not is_whole and len(answer) < LONGEST_LINE:
            raise DeviceError(
                f"{request} answered half: {_show(line, line_end)}, and no more within"
                f" {ANSWER_TIMEOUT:g} s: it must answer {wanted}"
            )
        if line not in exchange.answers:
            raise DeviceError(
                f"{request} answered {_show(line, line_end)}: it must answer {wanted}"
            )
        return exchange.answers[line]

    def _lose(self, error: Exception) -> DeviceError:
        return DeviceError(
            f"the relay at {self._path} is gone ({error}): plug it in again, and see to its cable"
        )


def find_serial_library() -> Any:
    """Return pySerial; raises `ModuleNotFoundError` if it is not installed."""
    # With its tools: there is another package that is called serial, and has none.
    import serial.tools.list_ports

    return serial


def _show(data: bytes, line_end: bytes) -> str:
    """Return bytes as the protocol's manual would print them."""
    if line_end:
        return repr(data.decode("ascii", "backslashreplace").strip())
    return data.hex(" ").upper()


def _explain(path: str, error: Exception) -> str:
    """Return why a port could not be opened, and what would help."""
    number = getattr(error, "errno", None)
    if number == errno.ENOENT:
        return (
            f"there is no serial port {path}: plug the relay in, or correct port in [holder];"
            " `impact-rig devices` lists what is there"
        )
    if number in (errno.EACCES, errno.EPERM):
        return (
            f"no permission to open {path}: add this user to the group that owns it, often"
            " dialout, and log in anew"
        )
    if number in (errno.EAGAIN, errno.EBUSY):
        return f"{path} is in use by {_find_users(path)}: end that program first"
    return f"{path} cannot be used as a serial port: {error}"


def _find_users(path: str) -> str:
    """Return who else has a file open, as far as this user may see it."""
    target = os.path.realpath(path)
    users = []
    for process in Path("/proc").glob("[0-9]*"):
        # A process may end while it is looked at, or belong to somebody else.
        with contextlib.suppress(OSError):
            if process.name != str(os.getpid()) and any(
                os.path.realpath(item) == target for item in (process / "fd").iterdir()
            ):
                name = (process / "comm").read_text("utf-8").strip()
                users.append(f"{name} (process {process.name})")
    return ", ".join(users) or "another program"
