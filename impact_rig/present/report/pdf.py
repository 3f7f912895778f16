"""A page on paper: printed by a browser of the Chromium family, without a screen."""

import contextlib
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from impact_rig.core.errors import DeviceError

BROWSERS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "msedge",
    "microsoft-edge",
)
"""Commands that can print without a screen, the free one first."""
LONGEST_PRINTING = 180.0
"""After which the browser is given up [s], our choice: a report takes a few seconds."""
PDF_START = b"%PDF-"
"""What every PDF file begins with."""


def find_browser() -> Path:
    """Find a browser that can print.

    Raises
    ------
    DeviceError
        If there is none in PATH.
    """
    for name in BROWSERS:
        found = shutil.which(name)
        if found is not None:
            return Path(found)
    raise DeviceError(
        "the PDF needs a browser that prints: install chromium (on Debian and Ubuntu"
        " `apt install chromium`), Google Chrome or Microsoft Edge"
    )


def print_pdf(page: str, path: Path, browser: Path) -> None:
    """Print a page on A4.

    The browser gets a profile of its own, which is removed, and no network is needed.

    Parameters
    ----------
    page : str
        HTML.
    path : Path
        Of the PDF file.
    browser : Path
        See `find_browser`.

    Raises
    ------
    DeviceError
        If the browser fails or takes longer than three minutes.
    """
    with tempfile.TemporaryDirectory(prefix="impact-rig-", ignore_cleanup_errors=True) as folder:
        source, printed = Path(folder, "report.html"), Path(folder, "report.pdf")
        source.write_text(page, encoding="utf-8")
        _run(browser, _make_options(Path(folder, "profile"), source, printed))
        if not printed.is_file() or not printed.read_bytes().startswith(PDF_START):
            raise DeviceError(f"{browser} printed no PDF: it may be too old (Chromium 112 does)")
        shutil.copyfile(printed, path)


def _make_options(profile: Path, source: Path, printed: Path) -> list[str]:
    options = [
        "--headless",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        "--disable-background-networking",
        "--disable-breakpad",
        "--no-first-run",
        "--no-pdf-header-footer",
        f"--user-data-dir={profile}",
        f"--print-to-pdf={printed}",
    ]
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        options.append("--no-sandbox")  # Chromium's sandbox refuses to work for root
    return [*options, source.as_uri()]


def _run(browser: Path, options: Sequence[str]) -> None:
    try:
        process = subprocess.Popen(
            [str(browser), *options],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
    except OSError as error:
        raise DeviceError(f"{browser} cannot be started: {error.strerror or error}") from None
    try:
        _, errors = process.communicate(timeout=LONGEST_PRINTING)
    except subprocess.TimeoutExpired:
        raise DeviceError(
            f"{browser} printed nothing within {LONGEST_PRINTING:.0f} s and was ended"
        ) from None
    finally:
        _end_group(process)
    if process.returncode:
        last = errors.decode(errors="replace").strip().splitlines()[-1:] or ["without a word"]
        raise DeviceError(f"{browser} ended with code {process.returncode}: {last[0]}")


def _end_group(process: "subprocess.Popen[bytes]") -> None:
    """End the browser with all that it started."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
