"""The page in a real browser: on a screen, on a phone, dark, and on paper."""

import html
import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from impact_rig.present.report.page import (
    Document,
    Facts,
    Folded,
    Paragraph,
    Remark,
    Remarks,
    Section,
    render_page,
)
from impact_rig.results.table import make_table, make_text_column

PHONE, DESK = 360, 1200
IS_WIDER = "page.documentElement.scrollWidth > page.documentElement.clientWidth"
UNFOLD = "page.querySelectorAll('details').forEach(item => item.open = true)"


class Chromium:
    """Chromium without a screen, started for each question.

    Parameters
    ----------
    folder : Path
        For its profile and for what it writes.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._program = shutil.which("chromium") or shutil.which("google-chrome")
        if self._program is None:
            pytest.skip("no browser looks at the page: on Debian, apt-get install chromium")

    def evaluate(self, page: str, expression: str, width: int) -> Any:
        """Return what JavaScript finds in a `page` that is shown this wide."""
        path = self.folder / "frame.html"
        style = f"width:{width}px;height:900px"
        path.write_text(
            f"<iframe style='{style}' srcdoc=\"{html.escape(page)}\"></iframe>"
            "<script>onload = () => { const page = document.querySelector('iframe')"
            f".contentDocument; document.title = JSON.stringify({expression}); }}</script>",
            encoding="utf-8",
        )
        dumped = self._run("--dump-dom", path.as_uri())
        (title,) = re.findall("<title>(.*?)</title>", dumped.partition("<iframe")[0])
        return json.loads(html.unescape(title))

    def print(self, page: str) -> bytes:
        """Return the PDF that it prints."""
        path, paper = self.folder / "page.html", self.folder / "page.pdf"
        path.write_text(page, encoding="utf-8")
        self._run(f"--print-to-pdf={paper}", path.as_uri())
        return paper.read_bytes()

    def _run(self, *words: str) -> str:
        options = ["--headless", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars"]
        options += ["--no-sandbox"] if os.geteuid() == 0 else []
        options += [f"--user-data-dir={self.folder / 'profile'}"]
        return subprocess.run(
            [str(self._program), *options, *words],
            check=True,
            capture_output=True,
            text=True,
            timeout=100.0,
        ).stdout


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Chromium:
    return Chromium(tmp_path_factory.mktemp("browser"))


@pytest.mark.parametrize("width", [PHONE, DESK])
def test_the_page_never_scrolls_sideways_and_every_image_fits(chromium, page, width):
    images = "[...page.images].map(image => [image.naturalWidth, image.clientWidth])"
    questions = f"[{IS_WIDER}, {images}, {UNFOLD}, {IS_WIDER}]"
    wider, widths, _, wider_unfolded = chromium.evaluate(page, questions, width)
    assert (wider, wider_unfolded) == (False, False)
    assert len(widths) >= 7
    assert all(natural > 0 and PHONE / 2 < shown <= width for natural, shown in widths)


@pytest.mark.parametrize("width", [PHONE, DESK])
def test_no_name_is_too_long_for_the_page(chromium, width):
    word = "x" * 300
    section = Section(
        word,
        (
            Paragraph(word),
            Facts(((word, word),)),
            Remarks((Remark(word, word),), is_warning=True),
            make_table(word, [make_text_column(word, [word, word])], [word]),
            Folded(word, (Paragraph(word),)),
        ),
    )
    document = Document(word, word, word, word, word, True, ((word, word),), (section,))
    found = chromium.evaluate(render_page(document), f"[{UNFOLD}, {IS_WIDER}]", width)
    assert found == [None, False]


def test_paper_is_a4_and_leaves_out_what_is_folded(chromium, page):
    folded, unfolded = (
        chromium.print(text) for text in (page, page.replace("<details>", "<details open>"))
    )
    pages = [len(re.findall(rb"/Type\s*/Page\b", content)) for content in (folded, unfolded)]
    assert 2 < pages[0] < pages[1]
    assert len(re.findall(rb"/MediaBox \[0 0 59[45]", folded)) == pages[0]
