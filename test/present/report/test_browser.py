"""The page in a real browser: on a screen, on a phone, dark, and on paper."""

import re

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
IS_WIDER = "document.documentElement.scrollWidth > document.documentElement.clientWidth"
UNFOLD = "document.querySelectorAll('details').forEach(item => item.open = true)"


@pytest.fixture
def show(browser):
    """Return a function that shows a text as a page this wide."""
    shown = []

    def show_page(text: str, width: int = DESK):
        shown.append(browser.new_page(viewport={"width": width, "height": 900}))
        shown[-1].set_content(text)
        return shown[-1]

    yield show_page
    for page in shown:
        page.close()


@pytest.mark.parametrize("width", [PHONE, DESK])
def test_the_page_never_scrolls_sideways_and_every_image_fits(show, page, width):
    images = "[...document.images].map(image => [image.naturalWidth, image.clientWidth])"
    questions = f"[{IS_WIDER}, {images}, {UNFOLD}, {IS_WIDER}]"
    wider, widths, _, wider_unfolded = show(page, width).evaluate(questions)
    assert (wider, wider_unfolded) == (False, False)
    assert len(widths) >= 7
    assert all(natural > 0 and PHONE / 2 < shown <= width for natural, shown in widths)


@pytest.mark.parametrize("width", [PHONE, DESK])
def test_no_name_is_too_long_for_the_page(show, width):
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
    found = show(render_page(document), width).evaluate(f"[{UNFOLD}, {IS_WIDER}]")
    assert found == [None, False]


def test_paper_is_a4_and_leaves_out_what_is_folded(show, page):
    folded, unfolded = (
        show(text).pdf(prefer_css_page_size=True)
        for text in (page, page.replace("<details>", "<details open>"))
    )
    pages = [len(re.findall(rb"/Type\s*/Page\b", content)) for content in (folded, unfolded)]
    assert 2 < pages[0] < pages[1]
    assert len(re.findall(rb"/MediaBox \[0 0 59[45]", folded)) == pages[0]
