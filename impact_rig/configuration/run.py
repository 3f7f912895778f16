"""A run: its settings beside the rig file, and its folder."""

import json
import os
import shlex
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

from impact_rig.configuration.processes import (
    RECORDING_NAME,
    RESULTS_NAME,
    VIEW_NAME,
    choose_run_folder,
    list_rig_processes,
)
from impact_rig.configuration.rig_file import RigFile
from impact_rig.core.errors import FileError, ParameterError

SOURCE = "source"
"""Name of the rig file's table [source] in settings."""


def make_virtual_source(
    *, plant: str | None, seed: int | None, faults: float | None
) -> dict[str, Any]:
    """Return the keys of the table [source] that the virtual rig's options set."""
    given = {"plant": plant, "seed": seed, "fault_probability": faults}
    return {name: value for name, value in given.items() if value is not None}


def parse_settings(settings: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """Read ``NODE.PARAMETER=VALUE`` texts into parameters by node.

    ``source.KEY=VALUE`` is a key of the rig file's table [source].

    Raises
    ------
    ParameterError
        If a text has another form, or the rig has no such node.
    """
    nodes = [process.name for process in list_rig_processes("")]
    known = [*nodes, SOURCE]
    parsed: dict[str, dict[str, Any]] = {}
    for text in settings:
        place, equals, value = text.partition("=")
        node, dot, parameter = place.partition(".")
        if not (equals and dot and parameter):
            raise ParameterError(
                f"--set {text!r}: write NODE.PARAMETER=VALUE, for example hammer.swing_time=0.3"
            )
        if node not in known:
            raise ParameterError(f"--set {text!r}: the rig has no node {node!r}, it has {nodes}")
        try:
            parsed.setdefault(node, {})[parameter] = json.loads(value)
        except json.JSONDecodeError:
            parsed.setdefault(node, {})[parameter] = value
    return parsed


def parse_number(name: str, text: str, kind: Callable[[str], float | int]) -> Any:
    """Return a launch argument as a number; None if it is empty."""
    try:
        return kind(text) if text else None
    except ValueError:
        wanted = "a whole number" if kind is int else "a number"
        raise ParameterError(f"{name}:={text}: it must be {wanted}") from None


def choose_view(wanted: str, executable: Path) -> bool:
    """Return whether to start the visualizer: as wanted, or where it can show anything.

    Parameters
    ----------
    wanted : str
        `true`, `false`, or `auto`: where rerun-sdk is installed.
    executable : Path
        The visualizer's; it begins with the Python that runs it, which may be another than this.

    Raises
    ------
    FileError
        If it is wanted, and that Python has no rerun-sdk.
    """
    if wanted == "false":
        return False
    python = executable.read_text("utf-8").splitlines()[0].removeprefix("#!")
    search = "import importlib.util, sys; sys.exit(importlib.util.find_spec('rerun') is None)"
    has_rerun = subprocess.run([*shlex.split(python), "-c", search], check=False).returncode == 0
    if wanted == "true" and not has_rerun:
        raise FileError(f"visualizer:=true: rerun-sdk is not installed for {python}")
    return has_rerun


def check_samples(rig_file: RigFile, names: tuple[str, ...]) -> None:
    """Require known samples; raises `ParameterError`."""
    for name in names:
        rig_file.setup.samples.find(name)
        if names.count(name) > 1:
            raise ParameterError(f"sample {name!r} is named twice")


def make_run_folder(output: Path | None) -> Path:
    """Make the folder of a run, and refuse one that already holds a run.

    Raises
    ------
    FileError
        If the folder holds a run, or cannot be made or written.
    """
    folder = choose_run_folder(output)
    for name in (RECORDING_NAME, VIEW_NAME, RESULTS_NAME):
        if (folder / name).exists():
            raise FileError(
                f"the folder {folder} already holds a run ({name}): choose another output folder"
            )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"the folder {folder} cannot be made: {error.strerror}") from None
    if not os.access(folder, os.W_OK):
        raise FileError(f"the folder {folder} cannot be written: choose another output folder")
    return folder
