"""Lists of channels in JSON, as the tools of sdypy exchange them (SEP 005)."""

import json
from pathlib import Path

import numpy as np

from impact_rig.core.given.errors import FileError
from impact_rig.files.formats.arrays import NamedArray, make_measurement
from impact_rig.files.measurement import Measurement

LIST_MARK = b"["
"""Beginning of such a list; results of a rig begin otherwise."""


def is_list(path: Path) -> bool:
    """Return whether a file of JSON holds a list, not results."""
    try:
        with path.open("rb") as file:
            return file.read(64).lstrip().startswith(LIST_MARK)
    except OSError:
        return False


def read_sep005(path: Path) -> Measurement:
    """Read the channels of a list: `name`, `data`, `fs` [Hz] and `unit_str` of each.

    Raises
    ------
    FileError
        If the file is no such list.
    """
    content = json.loads(path.read_text("utf-8"))
    if not isinstance(content, list) or not all(isinstance(item, dict) for item in content):
        raise FileError(
            f"{path} is no list of channels: each should have name, data, fs, unit_str"
        )
    arrays = [
        NamedArray(
            str(item.get("name", f"channel {number}")),
            np.asarray(item.get("data", ())),
            {
                "sampling_rate": float(item.get("fs", np.nan)),
                "unit": str(item.get("unit_str", "")),
            },
        )
        for number, item in enumerate(content, start=1)
    ]
    return make_measurement(path, arrays)
