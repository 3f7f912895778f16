"""An output line of a single-board computer: the driver `gpio`."""

import contextlib
import errno
from pathlib import Path
from typing import Any, ClassVar

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.errors import DeviceError
from impact_rig.devices.protocols import (
    FoundDevice,
    HolderState,
    ToldHolder,
    take_energized_state,
)

HIGHEST_LINE = 4095
"""Of a chip [-]: more than any has, our choice."""
CONSUMER = "impact_rig hammer"
"""What `gpioinfo` says of the line while we have it."""


class GpioHolder(ToldHolder):
    """Switches an output pin, which it has for itself from `configure` to `close`.

    What becomes of the pin after `close`, or when the process ends, is the chip's choice: most
    leave it as it is. A resistor at the pin decides for the time before and, if need be, after.

    Parameters
    ----------
    options : TomlTable
        `chip`, `line`, `energized`, `active_low`.

    Raises
    ------
    ParameterError
        If a key is missing or unknown, or its value cannot be meant.
    """

    description: ClassVar[str] = "an output pin of this computer (GPIO of Linux)"
    example: ClassVar[str] = """\
[holder]
driver = "gpio"
chip = "/dev/gpiochip0"
line = 17               # number on the chip, or its name in quotes
energized = "releases"  # or "holds": what magnet or latch does while the line is active
active_low = false      # true: the line is active while its pin is low
"""

    def __init__(self, options: TomlTable) -> None:
        options.check_keys("chip", "line", "energized", "active_low")
        self._chip = options.take_text("chip", "/dev/gpiochip0")
        self._line = _take_line(options)
        self._is_active_low = options.take_boolean("active_low")
        self._active = take_energized_state(options, HolderState.RELEASED)
        self._request: Any = None

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return this computer's chips; one that may not be opened has no identity."""
        gpiod = _import_gpiod()
        return tuple(
            FoundDevice(str(path), _identify(path))
            for path in sorted(Path("/dev").glob("gpiochip*"))
            if gpiod.is_gpiochip_device(str(path))
        )

    def configure(self) -> str:
        """Take the line as an output that holds from its first moment."""
        gpiod = _import_gpiod()
        self.close()
        settings = gpiod.LineSettings(
            direction=gpiod.line.Direction.OUTPUT,
            active_low=self._is_active_low,
            output_value=self._make_value(HolderState.HOLDING),
        )
        try:
            self._request = gpiod.request_lines(
                self._chip, {self._line: settings}, consumer=CONSUMER
            )
        except (OSError, ValueError) as error:
            raise DeviceError(explain_refusal(self._chip, self._line, error)) from None
        self.told = HolderState.HOLDING
        return f"line {self._line} of {self._chip} ({_identify(Path(self._chip))})"

    def read_state(self) -> HolderState:
        """Read the line back."""
        request = self._get_request()
        try:
            is_told = request.get_value(self._line) is self._make_value(self.told)
        except OSError as error:
            raise self._lose(error) from None
        if not is_told:
            raise DeviceError(
                f"line {self._line} of {self._chip} does not read as {self.told.value}, as it was"
                " told to be: look for a short circuit"
            )
        return self.told

    def close(self) -> None:
        """Let the line go as it is."""
        if self._request is not None:
            with contextlib.suppress(OSError):
                self._request.release()
            self._request = None

    def tell(self, state: HolderState) -> None:
        """Bring the device into a state; raises `DeviceError` if it does not obey."""
        request = self._get_request()
        try:
            request.set_value(self._line, self._make_value(state))
        except OSError as error:
            raise self._lose(error) from None
        self.told = state

    def _make_value(self, state: HolderState) -> Any:
        value = _import_gpiod().line.Value
        return value.ACTIVE if state is self._active else value.INACTIVE

    def _get_request(self) -> Any:
        if self._request is None:
            raise DeviceError(
                f"line {self._line} of {self._chip} is not ours: configure the holder first"
            )
        return self._request

    def _lose(self, error: OSError) -> DeviceError:
        return DeviceError(f"line {self._line} of {self._chip} does not obey any more: {error}")


def explain_refusal(chip: str, line: int | str, error: Exception) -> str:
    """Return why a line could not be had, and what would help."""
    number = getattr(error, "errno", None)
    if number == errno.ENOENT:
        if Path(chip).exists():
            return f"{chip} has no line {line!r}: `gpioinfo` lists what it has"
        return (
            f"there is no GPIO chip {chip}: correct chip in [holder]; `impact-rig devices` lists"
            " what is there"
        )
    if number in (errno.EACCES, errno.EPERM):
        return (
            f"no permission to open {chip}: add this user to the group that owns it, often gpio,"
            " and log in anew"
        )
    if number == errno.EBUSY:
        return f"line {line} of {chip} is in use by another program: `gpioinfo` names it"
    if number in (errno.ENODEV, errno.ENOTTY):
        return f"{chip} is no GPIO chip: correct chip in [holder]"
    return f"line {line} of {chip} cannot be used as an output: {error}"


def _import_gpiod() -> Any:
    """Return gpiod; raises `DeviceError` if it is the one before 2.0."""
    import gpiod

    if not hasattr(gpiod, "request_lines"):
        raise DeviceError(
            "the Python package gpiod is one before 2.0, as Debian's python3-libgpiod was: install"
            " gpiod 2.1 or newer"
        )
    return gpiod


def _take_line(options: TomlTable) -> int | str:
    if isinstance(options.get("line"), str):
        name = options.take_text("line")
        if not name:
            raise options.refuse("line", "its number on the chip, or its name in quotes")
        return name
    return options.take_whole("line", 0, HIGHEST_LINE)


def _identify(path: Path) -> str:
    """Return what a chip says of itself, empty if it may not be asked."""
    try:
        with _import_gpiod().Chip(str(path)) as chip:
            info = chip.get_info()
    except OSError:
        return ""
    return f"{info.label}, {info.num_lines} lines"
