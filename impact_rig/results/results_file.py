"""results.json: written whole or not at all, read with errors that say what is wrong.

JSON numbers are written as Python's `repr` does, so that they come back bit by bit; what is not
determined (NaN) is null.
"""

import json
import os
import re
import tempfile
from pathlib import Path
from typing import Any

from impact_rig.core.errors import FileError
from impact_rig.core.origin import Origin
from impact_rig.results.campaign import Results
from impact_rig.results.size_exponents import find_size_exponents
from impact_rig.results.wire import Json, WireError, from_json, to_json

FORMAT_NAME = "impact-rig results"
FORMAT_VERSION = 6
UNSAFE = re.compile("[\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""What JSON may hold as it is, and terminals take for a command or an end of the line."""
LARGEST_WHOLE = 2**63
"""Whole numbers are below this [-]: those of messages are, and double precision reaches it."""
OLDEST_VERSION = 3
"""Versions from this one on are read: what they lack says so by its `since`."""


def results_to_json(results: Results) -> Json:
    """Return the content of results.json as plain dicts, lists, strings and numbers."""
    return {
        "format": {"name": FORMAT_NAME, "version": FORMAT_VERSION},
        **origin_to_json(results.origin),
        **to_json(results),
        # They follow from the samples: nobody reads them back.
        "size_exponents": [to_json(item) for item in find_size_exponents(results)],
    }


def origin_to_json(origin: Origin) -> Json:
    """Return what a file says at its beginning of the origin of all that is in it."""
    return {"origin": origin.kind, "origin_source": origin.source}


def format_json(content: Any) -> str:
    """Return JSON text as every command prints it: indented, ending in a new line."""
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    return UNSAFE.sub(lambda letter: f"\\u{ord(letter[0]):04x}", text) + "\n"


def write_results(path: Path, results: Results) -> None:
    """Write results.json; whoever looks finds the old file or the whole new one.

    Parameters
    ----------
    path : Path
        Of the file; its folder must exist.

    Raises
    ------
    FileError
        If the file cannot be written. Nothing half-written is left.
    """
    text = format_json(results_to_json(results))
    temporary: Path | None = None
    try:
        with tempfile.NamedTemporaryFile(
            "w",
            encoding="utf-8",
            dir=path.parent,
            prefix=f".{path.name}.",
            suffix=".part",
            delete=False,
        ) as file:
            temporary = Path(file.name)
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        # Temporary files are private; results are as readable as any other new file.
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        temporary.replace(path)
    except OSError as error:
        if temporary:
            temporary.unlink(missing_ok=True)
        reason = error.strerror or error
        raise FileError(
            f"results {path}: cannot be written ({reason}); give a folder that exists and that"
            " you may write to"
        ) from None


def read_results(path: Path) -> Results:
    """Read results.json.

    Raises
    ------
    FileError
        If the file cannot be read, is no results file, or is of a newer version.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"), parse_int=_parse_whole)
    except OSError as error:
        raise FileError(f"results {path}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:
        raise FileError(f"results {path}: is not JSON ({error})") from None
    except RecursionError:
        raise FileError(f"results {path}: is nested too deep to be results") from None
    kind = content.get("format") if isinstance(content, dict) else None
    if not isinstance(kind, dict) or kind.get("name") != FORMAT_NAME:
        raise FileError(
            f"results {path}: is not a results file; one has the format name {FORMAT_NAME!r}"
        )
    version = kind.get("version")
    if not isinstance(version, int) or not OLDEST_VERSION <= version <= FORMAT_VERSION:
        raise FileError(
            f"results {path}: has format version {version!r}; this program reads versions"
            f" {OLDEST_VERSION} to {FORMAT_VERSION}"
        )
    try:
        return from_json(Results, content, version)
    except WireError as error:
        raise FileError(f"results {path}: {error}") from None


def _parse_whole(digits: str) -> int:
    number = int(digits)
    if abs(number) >= LARGEST_WHOLE:
        raise ValueError(f"a whole number of {len(digits)} digits: it must be below 2^63")
    return number
