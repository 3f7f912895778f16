"""Runs the units of a study over the cores, and goes on where an earlier run was stopped."""

import fcntl
import json
import math
import os
import signal
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from pathlib import Path
from types import TracebackType
from typing import Any, Self
from zlib import crc32

from impact_rig import __version__
from impact_rig.core.errors import FileError, NotDeterminedError, RigError
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.study.campaigns import CampaignSource, Outcome, evaluate
from impact_rig.study.cases import Configuration, Part, find_case, list_cases
from impact_rig.study.selection import SelectionCount, simulate_series

UNIT_CAMPAIGNS = 20
"""Campaigns of one unit [-], our choice: a second or two of work, which Ctrl-C waits for."""
SELECTION_KEY = "selection/hits/all"

Json = dict[str, Any]


@dataclass(frozen=True)
class Unit:
    """A stretch of campaigns of one case.

    Attributes
    ----------
    part : Part
        It belongs to.
    key : str
        Of the case.
    first, count : int
        Campaigns, counted from 0.
    """

    part: Part
    key: str
    first: int
    count: int

    @property
    def name(self) -> str:
        """Unique in the study."""
        return f"{self.key}#{self.first}+{self.count}"


def plan_units(configuration: Configuration) -> tuple[Unit, ...]:
    """Return all units of a study, in the order of its parts."""
    units: list[Unit] = []
    for part in configuration.parts:
        total = configuration.count_campaigns(part)
        keys = [case.key for case in list_cases(part)] or [SELECTION_KEY]
        units += [
            Unit(part, key, first, min(UNIT_CAMPAIGNS, total - first))
            for key in keys
            for first in range(0, total, UNIT_CAMPAIGNS)
        ]
    return tuple(units)


def run_unit(unit: Unit, seed: int) -> Json:
    """Do the work of one unit.

    Returns
    -------
    dict
        Plain values, all that is kept of the unit. The same unit and seed give the same values.
    """
    entropy = (seed, crc32(unit.key.encode()))
    numbers = range(unit.first, unit.first + unit.count)
    if unit.part is Part.SELECTION:
        counts = (simulate_series(PAPER_SETUP, entropy, number) for number in numbers)
        return sum(counts, SelectionCount()).to_json()
    source = CampaignSource(find_case(unit.key), PAPER_SETUP, entropy)
    outcomes: list[Outcome] = []
    lost = 0
    for number in numbers:
        try:
            campaign = source.run(number)
        except NotDeterminedError:
            lost += 1
            continue
        outcomes += evaluate(campaign)
    return {"lost": lost, "outcomes": _collect(outcomes)}


def _collect(outcomes: Iterable[Outcome]) -> dict[str, dict[str, list[float | None]]]:
    """Return columns of numbers by estimator and quantity; None is NaN."""
    columns: dict[str, dict[str, list[float | None]]] = {}
    for outcome in outcomes:
        column = columns.setdefault(
            f"{outcome.estimator}/{outcome.quantity}",
            {"errors": [], "half_widths": [], "bounds": []},
        )
        for name, value in (
            ("errors", outcome.error),
            ("half_widths", outcome.half_width),
            ("bounds", outcome.bound),
        ):
            column[name].append(value if math.isfinite(value) else None)
    return columns


CONFIGURATION_NAME = "configuration.json"
UNITS_NAME = "units.jsonl"
"""One line of JSON per finished unit, in the order they were finished."""
FORMAT_NAME = "impact-rig study"
FORMAT_VERSION = 1


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
            text = json.dumps(wanted, indent=2) + "\n"
            self.write_bytes(CONFIGURATION_NAME, text.encode())
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


Report = Callable[[int, int], None]
"""Takes finished and all campaigns."""


def run_units(
    configuration: Configuration, folder: StudyFolder, jobs: int, report: Report
) -> None:
    """Do what is missing in the folder.

    Numbers do not depend on `jobs`: every campaign has random numbers of its own, and even a
    single job runs in a process of its own.

    Parameters
    ----------
    folder : StudyFolder
        Takes each unit as it is finished.
    jobs : int
        Processes.
    report : callable
        Is called with the finished and all campaigns, at the start and after each unit.

    Raises
    ------
    KeyboardInterrupt
        After the units that were running are kept.
    RigError
        If a process was killed.
    """
    units = plan_units(configuration)
    total = sum(unit.count for unit in units)
    done = sum(unit.count for unit in units if unit.name in folder.finished)
    report(done, total)
    missing = [unit for unit in units if unit.name not in folder.finished]
    if not missing:
        return
    # Fresh processes: what the command line has set for linear algebra is read in them.
    with ProcessPoolExecutor(
        min(jobs, len(missing)), mp_context=get_context("spawn"), initializer=_start_worker
    ) as pool:
        futures = {pool.submit(run_unit, unit, configuration.seed): unit for unit in missing}
        try:
            for future in as_completed(futures):
                unit = futures[future]
                folder.keep(unit.name, future.result())
                done += unit.count
                report(done, total)
        except BaseException as error:
            pool.shutdown(wait=True, cancel_futures=True)
            for future, unit in futures.items():
                is_lost = future.cancelled() or future.exception() is not None
                if not is_lost and unit.name not in folder.finished:
                    folder.keep(unit.name, future.result())
            if isinstance(error, BrokenProcessPool):
                raise RigError(
                    "a process of the study was killed, perhaps for want of memory: the same"
                    " command with the same --output goes on"
                ) from None
            raise


def _start_worker() -> None:
    """Leave Ctrl-C to the parent, and end when the parent is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
