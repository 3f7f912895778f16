"""Text files that a person wrote."""

from pathlib import Path

from impact_rig.core.errors import FileError


def read_text_file(path: Path, what: str) -> str:
    """Return the text of a file; `what` it is, for the message.

    Raises
    ------
    FileError
        If there is no such file, or it is no text.
    """
    try:
        return path.read_text("utf-8-sig")
    except FileNotFoundError:
        raise FileError(f"there is no {what} {path}: check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"the {what} {path} cannot be read: {error}") from None
