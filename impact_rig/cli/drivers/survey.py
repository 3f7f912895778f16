"""Which drivers are installed, whether they can work, and which devices they find."""

import json
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from impact_rig.cli.checks.software_checks import find_library
from impact_rig.devices.drivers import HOLDERS, SOURCES, Driver, find_drivers
from impact_rig.devices.found_device import FoundDevice

SEARCH_TIMEOUT = 15.0
"""How long a driver may search [s], our choice: some ask a network."""
KINDS = {SOURCES: "source", HOLDERS: "holder"}
ENDLESS = "its search for devices did not come to an end"


@dataclass(frozen=True)
class SurveyedDriver:
    """A driver, and what its search has found.

    Attributes
    ----------
    kind : str
        "source" or "holder".
    name, package : str
        As the rig file names it, and the distribution that brings it.
    description, example : str
        In its own words; empty where it could not be loaded.
    devices : tuple of FoundDevice
        Those that it could use.
    trouble : str
        Why it cannot work, or could not search; empty: it can.
    advice : str
        What to do about that, where it is known.
    """

    kind: str
    name: str
    package: str
    description: str = ""
    example: str = ""
    devices: tuple[FoundDevice, ...] = ()
    trouble: str = ""
    advice: str = ""


@dataclass(frozen=True)
class _Search:
    """A driver that searches in a process of its own: it may hang, or end that process."""

    kind: str
    driver: Driver
    process: subprocess.Popen[str]


def survey_drivers(name: str = "", timeout: float = SEARCH_TIMEOUT) -> list[SurveyedDriver]:
    """Let every driver search for its devices, all at the same time.

    Parameters
    ----------
    name : str
        Only the drivers of this name; empty: all.
    timeout : float
        For each of them [s]; who has not answered then is ended.

    Raises
    ------
    DeviceError
        If two packages bring drivers of the same name.
    """
    searches = [
        _start(group, driver)
        for group in KINDS
        for driver in find_drivers(group).values()
        if name in ("", driver.name)
    ]
    with ThreadPoolExecutor(max(1, len(searches))) as pool:
        try:
            return list(pool.map(lambda search: _await_answer(search, timeout), searches))
        finally:
            for search in searches:
                _end(search.process)


def _start(group: str, driver: Driver) -> _Search:
    words = [sys.executable, "-m", "impact_rig.cli.drivers.search_process", group, driver.name]
    process = subprocess.Popen(
        words,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )
    return _Search(KINDS[group], driver, process)


def _await_answer(search: _Search, timeout: float) -> SurveyedDriver:
    try:
        output, _ = search.process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        _end(search.process)
        search.process.communicate()
        return _describe(search, trouble=ENDLESS)
    return _read_answer(search, output)


def _read_answer(search: _Search, output: str) -> SurveyedDriver:
    try:
        answer = json.loads(output)
    except ValueError:
        code = search.process.returncode
        ended = f"signal {signal.Signals(-code).name}" if code < 0 else f"code {code}"
        return _describe(search, trouble=f"it crashed while it searched for devices ({ended})")
    library = find_library(answer["missing"])
    return _describe(
        search,
        description=answer["description"],
        example=answer["example"],
        devices=tuple(FoundDevice(*device) for device in answer["devices"]),
        trouble=answer["trouble"],
        advice=library.advice if library else "",
    )


def _describe(
    search: _Search,
    *,
    description: str = "",
    example: str = "",
    devices: tuple[FoundDevice, ...] = (),
    trouble: str = "",
    advice: str = "",
) -> SurveyedDriver:
    return SurveyedDriver(
        search.kind, search.driver.name, search.driver.package,
        description, example, devices, trouble, advice,
    )  # fmt: skip


def _end(process: subprocess.Popen[str]) -> None:
    """End a search that goes on, with whatever it has started."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
