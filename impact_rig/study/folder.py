"""The folder of a study: what was asked, the finished units, and the results."""

import fcntl
import json
import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from impact_rig import __version__
from impact_rig.core.errors import FileError
from impact_rig.study.cases import Configuration

CONFIGURATION_NAME = "configuration.json"
UNITS_NAME = "units.jsonl"
"""One line of JSON per finished unit, in the order they were finished."""
FORMAT_NAME = "impact-rig study"
FORMAT_VERSION = 1

Json = dict[str, Any]


def describe_configuration(configuration: Configuration) -> Json:
    """Return what must be the same for a study to go on, as plain values."""
    return {
        "format": {"name": FORMAT_NAME, "version": FORMAT_VERSION},
        "program_version": __version__,
        "parts": [part.value for part in configuration.parts],
        "campaigns": configuration.campaigns,
        "seed": configuration.seed,
    }


class StudyFolder:
    """A folder that a study owns while it runs; a context manager.

    Parameters
    ----------
    path : Path
        New, empty, or of the same study stopped earlier.
    configuration : Configuration
        What is asked.

    Attributes
    ----------
    finished : dict of str to dict
        What each finished unit found, by the unit's name.

    Raises
    ------
    FileError
        If the folder holds another study or something else, is in use, or cannot be written.
    """

    def __init__(self, path: Path, configuration: Configuration) -> None:
        self.path = path
        try:
            path.mkdir(parents=True, exist_ok=True)
            self._check_configuration(describe_configuration(configuration))
            self._file = (path / UNITS_NAME).open("a+b")
        except OSError as error:
            raise FileError(
                f"the folder {path} cannot be used: {error.strerror}; choose another --output"
            ) from None
        try:
            self._lock()
            self.finished = self._read_units()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Self:
        """Return the folder."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Let go of the folder."""
        self._file.close()

    def keep(self, name: str, found: Json) -> None:
        """Keep what a unit found; once this returns, no kill takes it away."""
        line = json.dumps({"unit": name, "found": found}, allow_nan=False) + "\n"
        try:
            self._file.write(line.encode())
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise FileError(f"{self.path / UNITS_NAME}: {error.strerror}") from None
        self.finished[name] = found

    def write_text(self, name: str, text: str) -> None:
        """Write a file whole or not at all."""
        self.write_bytes(name, text.encode())

    def write_bytes(self, name: str, content: bytes) -> None:
        """Write a file whole or not at all."""
        part = self.path / f".{name}.part"
        try:
            part.write_bytes(content)
            part.replace(self.path / name)
        except OSError as error:
            with suppress(OSError):
                part.unlink(missing_ok=True)
            raise FileError(f"{self.path / name}: cannot be written ({error.strerror})") from None

    def _check_configuration(self, wanted: Json) -> None:
        path = self.path / CONFIGURATION_NAME
        if not path.exists():
            if any(self.path.iterdir()):
                raise FileError(
                    f"the folder {self.path} holds other files and no study: choose another"
                    " --output"
                )
            self.write_text(CONFIGURATION_NAME, json.dumps(wanted, indent=2) + "\n")
            return
        try:
            found = json.loads(path.read_text("utf-8"))
        except ValueError as error:
            raise FileError(f"{path}: is not JSON ({error})") from None
        if not isinstance(found, dict) or found.get("format") != wanted["format"]:
            raise FileError(f"{path}: is not the configuration of a study of this program")
        for name, value in wanted.items():
            if found.get(name) != value:
                raise FileError(
                    f"the folder {self.path} holds another study: its {name.replace('_', ' ')} is"
                    f" {_say(found.get(name))}, here it is {_say(value)}; choose another --output"
                )

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise FileError(
                f"the folder {self.path} is in use: another study is running in it"
            ) from None

    def _read_units(self) -> dict[str, Json]:
        """Return the finished units; a line that a kill cut short is taken away."""
        self._file.seek(0)
        content = self._file.read()
        whole = content.rfind(b"\n") + 1
        self._file.truncate(whole)
        return dict(self._parse_lines(content[:whole].splitlines()))

    def _parse_lines(self, lines: Iterable[bytes]) -> Iterable[tuple[str, Json]]:
        for number, line in enumerate(lines, start=1):
            try:
                entry = json.loads(line)
                yield entry["unit"], entry["found"]
            except (ValueError, KeyError, TypeError):
                raise FileError(
                    f"{self.path / UNITS_NAME}: line {number} is no finished unit; choose another"
                    " --output"
                ) from None


def _say(value: object) -> str:
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)
