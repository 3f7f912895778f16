"""Files that are not what they claim to be: told in a sentence, before they take memory."""

import contextlib
import warnings
from collections.abc import Iterator
from pathlib import Path

from impact_rig.core.errors import FileError, ParameterError, RigError

LARGEST_PACKING = 1032
"""How many times its packed size data may have: the limit of DEFLATE, which packs them all."""
SHOWN_LETTERS = 200
"""Of a library's complaint, our choice."""


@contextlib.contextmanager
def blame_file(path: Path) -> Iterator[None]:
    """Make a `FileError` of whatever a library trips over while it reads a file.

    Parameters
    ----------
    path : Path
        Of the file; its suffix says what it should be.

    Yields
    ------
    None

    Raises
    ------
    FileError
        If the block fails otherwise than by an error of the rig or a missing library.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except ParameterError as error:  # of a channel: it does not know its file
        raise FileError(f"{path}: {error}") from None
    except (RigError, ImportError):
        raise
    except Exception as error:  # noqa: BLE001 - damaged files break libraries in every way there is
        words = str(error).strip().splitlines() or [type(error).__name__]
        raise FileError(
            f"{path} is no sound {path.suffix.lower()} file: {words[0][:SHOWN_LETTERS]}"
        ) from None


def check_claim(path: Path, name: str, claimed: int, packing: int = 1) -> None:
    """Refuse an array that cannot be in its file, before room is made for it.

    Parameters
    ----------
    path : Path
        Of the file.
    name : str
        Of the array, for the message.
    claimed : int
        Size of the array, as the file states it [byte].
    packing : int
        How many times smaller it may be in the file; 1: it is not packed.

    Raises
    ------
    FileError
        If the file is too small.
    """
    size = path.stat().st_size
    if not 0 <= claimed <= packing * size:
        raise FileError(
            f"{path} is cut off or damaged: {name} should have {claimed} bytes, the file has"
            f" {size}"
        )
