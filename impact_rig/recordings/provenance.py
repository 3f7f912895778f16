"""The software, computer, notes and files with which a recording was made."""

import hashlib
import json
import mimetypes
import os
import platform
import time
from importlib import metadata
from pathlib import Path
from typing import Any

import yaml

from impact_rig.core.given.errors import FileError
from impact_rig.recordings.records import PARAMETERS_RECORD, Attachment, MetadataRecord
from impact_rig.version import __version__

LIBRARIES = ("numpy", "scipy", "mcap", "zstandard", "lz4", "rclpy")
"""Those on which it depends what is recorded and estimated."""
ATTACHMENT_LIMIT = 16 << 20
"""A larger file is not put into a recording [byte], our choice: a rig file has some kilobytes."""


def compute_sha256(path: Path) -> str:
    """Return the digest of a file; raises `FileError` if it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror}") from None


def describe_provenance(middleware: str, notes: str) -> dict[str, str]:
    """Return the fields of `PROVENANCE_RECORD`.

    Parameters
    ----------
    middleware : str
        Implementation of ROS's middleware in use.
    notes : str
        In the operator's words.
    """
    versions = {}
    for name in LIBRARIES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return {
        "software_version": __version__,
        "python": platform.python_version(),
        "ros_distro": os.environ.get("ROS_DISTRO", ""),
        "middleware": middleware,
        "libraries": json.dumps(versions),
        "host": platform.node(),
        "platform": platform.platform(),
        "notes": notes,
    }


def read_parameters(record: MetadataRecord, node: str) -> dict[str, Any]:
    """Return the parameters of a node in a metadata record; empty: they are not in it."""
    if record.name != PARAMETERS_RECORD:
        return {}
    for name, text in record.fields.items():
        if name.rpartition("/")[2] == node:
            found = yaml.safe_load(text)
            return found if isinstance(found, dict) else {}
    return {}


def read_attached_file(path: Path) -> Attachment:
    """Read a file that is to go into a recording.

    Raises
    ------
    FileError
        If it cannot be read or is larger than `ATTACHMENT_LIMIT`.
    """
    try:
        size = path.stat().st_size
        if size > ATTACHMENT_LIMIT:
            raise FileError(
                f"the attachment {path} has {size} byte: it must not have more than"
                f" {ATTACHMENT_LIMIT}"
            )
        data = path.read_bytes()
    except OSError as error:
        raise FileError(f"the attachment {path} cannot be read: {error.strerror}") from None
    kind = "application/toml" if path.suffix == ".toml" else mimetypes.guess_type(path)[0]
    return Attachment(path.name, kind or "application/octet-stream", time.time_ns(), data)
