"""The page in a real browser, and on paper."""

import os
import re
import sys
from pathlib import Path

import numpy as np
import psutil
import pytest

from impact_rig.core.errors import DeviceError
from impact_rig.present.report import pdf
from impact_rig.present.report.document import (
    Document,
    Facts,
    Folded,
    Listing,
    Paragraph,
    Remark,
    Remarks,
    Section,
)
from impact_rig.present.report.page import render_page
from impact_rig.present.report.pdf import find_browser, print_pdf
from impact_rig.results.tables import make_table, make_text_column

from ..contrast import compute_contrast

WHITE = (255, 255, 255)
DARK_GROUND = (0x11, 0x11, 0x11)
PHONE = 360
WIDER_THAN_IT = "document.documentElement.scrollWidth > document.documentElement.clientWidth"


@pytest.fixture(scope="module")
def files(page: str, comparison_page: str, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("pages")
    paths = [folder / "one.html", folder / "several.html"]
    for path, text in zip(paths, (page, comparison_page), strict=True):
        path.write_text(text, encoding="utf-8")
    return paths


def share_of_ink(picture: np.ndarray) -> float:
    """Return which part of the pixels is far from the ground."""
    ground = picture[0, 0].astype(int)
    return float(np.mean(np.abs(picture.astype(int) - ground).max(axis=2) > 60))


def test_the_browser_has_nothing_to_complain_of_and_asks_for_nothing(browser, files):
    for path in files:
        browser.open(path)
        browser.evaluate("document.querySelectorAll('details').forEach(d => d.open = true)")
        assert browser.complaints == []
        assert browser.requests == [path.as_uri()]


def test_a_browser_that_is_asked_to_load_something_is_seen_doing_so(browser, tmp_path):
    # What the test above relies on: the watcher sees requests and complaints.
    path = tmp_path / "asking.html"
    path.write_text("<img src='missing.png'><script>console.error('oh')</script>")
    browser.open(path)
    assert any(url.endswith("missing.png") for url in browser.requests)
    assert browser.complaints


@pytest.mark.parametrize("width", [PHONE, 600, 1200])
def test_the_page_never_scrolls_sideways(browser, files, width):
    for path in files:
        browser.open(path, width=width)
        for _ in range(2):
            assert not browser.evaluate(WIDER_THAN_IT)
            browser.evaluate("document.querySelectorAll('details').forEach(d => d.open = true)")


def test_no_name_is_too_long_for_the_page(browser, tmp_path):
    word = "x" * 300
    section = Section(
        word,
        (
            Paragraph(word),
            Facts(((word, word),)),
            Remarks((Remark(word, word),), is_warning=True),
            make_table(word, [make_text_column(word, [word, word])], [word]),
            Folded(word, (Listing(word, word),)),
        ),
    )
    path = tmp_path / "long.html"
    document = Document(word, word, word, word, True, ((word, word),), (section,))
    path.write_text(render_page(document, is_unfolded=True), encoding="utf-8")
    for width in (PHONE, 1200):
        browser.open(path, width=width)
        assert not browser.evaluate(WIDER_THAN_IT)


def test_wide_tables_scroll_in_their_own_box_on_a_phone(browser, files):
    browser.open(files[0], width=PHONE)
    boxes = browser.evaluate(
        "[...document.querySelectorAll('.table')].map(b => [b.clientWidth, b.scrollWidth])"
    )
    assert all(shown <= PHONE for shown, _ in boxes)
    assert any(whole > shown + 100 for shown, whole in boxes)


@pytest.mark.parametrize(
    ("dark", "ground"), [(False, WHITE), (True, DARK_GROUND)], ids=["light", "dark"]
)
def test_ink_stands_on_the_ground_of_the_scheme(browser, files, dark, ground):
    for width in (PHONE, 1200):
        browser.open(files[0], width=width, dark=dark)
        picture = browser.take_picture()
        assert tuple(picture[0, 0]) == ground
        assert 0.01 < share_of_ink(picture) < 0.4


def test_text_is_told_from_the_ground_in_both_schemes(browser, files):
    # WCAG 2.2, 1.4.3: at least 4.5 for text, computed from what the browser says it draws.
    script = """
    [...new Set([...document.querySelectorAll('p,dt,dd,th,td,a,summary,figcaption,li,b,caption')]
      .map(e => getComputedStyle(e).color))]
    """
    for dark in (False, True):
        browser.open(files[0], dark=dark)
        ground = DARK_GROUND if dark else WHITE
        colours = browser.evaluate(script)
        assert len(colours) >= 4
        for colour in colours:
            ink = tuple(int(value) for value in re.findall(r"\d+", colour)[:3])
            assert compute_contrast(ink, ground) >= 4.5, colour


def test_every_figure_has_ink(browser, files):
    browser.open(files[0])
    boxes = browser.evaluate(
        "[...document.querySelectorAll('figure svg')].map(s => s.getBoundingClientRect())"
        ".map(r => [r.x, r.y + scrollY, r.width, r.height].map(Math.round))"
    )
    assert len(boxes) >= 12
    picture = browser.take_picture(whole=True)
    for x, y, width, height in boxes:
        assert share_of_ink(picture[y : y + height, x : x + width]) > 0.005


def test_lines_of_text_are_short_enough_to_be_read(browser, files):
    browser.open(files[0], width=1600)
    widest = browser.evaluate(
        "Math.max(...[...document.querySelectorAll('main p:not(.title)')].map(p => p.clientWidth /"
        " parseFloat(getComputedStyle(p).fontSize)))"
    )
    assert widest <= 52  # em, about a hundred narrow letters or 75 to 80 of a text


def assert_nothing_runs(word: str) -> None:
    """Wait until no process has a word in its command line."""
    found = [
        process
        for process in psutil.process_iter(["cmdline"])
        if any(word in part for part in process.info["cmdline"] or ())
        and process.pid != os.getpid()
    ]
    _, alive = psutil.wait_procs(found, 30.0)
    assert alive == []


def write_browser(folder: Path, body: str) -> Path:
    """Write a program that stands in for a browser."""
    path = folder / "chromium"
    path.write_text(f"#!{sys.executable}\n{body}\n")
    path.chmod(0o755)
    return path


def test_without_a_browser_it_is_said_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(DeviceError, match="install chromium"):
        find_browser()


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("import sys; sys.exit('no display')", "ended with code 1: no display"),
        ("", "printed no PDF"),
    ],
)
def test_a_browser_that_fails_is_quoted_and_one_that_prints_nothing_not_believed(
    tmp_path, body, reason
):
    with pytest.raises(DeviceError, match=reason):
        print_pdf("", tmp_path / "x.pdf", write_browser(tmp_path, body))
    assert not (tmp_path / "x.pdf").exists()


def test_a_browser_that_hangs_is_ended_with_its_children(monkeypatch, tmp_path):
    monkeypatch.setattr(pdf, "LONGEST_PRINTING", 1.5)
    # Known by a word of its own: another run of the tests on this host has none of it.
    grandchild = [sys.executable, "-c", "import time; time.sleep(600)", str(tmp_path)]
    child = f"import subprocess, time; subprocess.Popen({grandchild!r}); time.sleep(600)"
    browser = write_browser(tmp_path, child)
    with pytest.raises(DeviceError, match="printed nothing within"):
        print_pdf("", tmp_path / "x.pdf", browser)
    assert_nothing_runs(str(tmp_path))


def test_only_root_goes_without_the_sandbox(monkeypatch, tmp_path):
    for user, expected in ((0, True), (1000, False)):
        monkeypatch.setattr(os, "geteuid", lambda user=user: user)
        options = pdf._make_options(tmp_path, tmp_path / "a", tmp_path / "b")
        assert ("--no-sandbox" in options) is expected
