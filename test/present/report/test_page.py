"""The page as HTML: read by a parser that knows nothing of its templates."""

import itertools
import re
from collections import Counter
from pathlib import Path

import impact_rig
from impact_rig.core.estimates.law_pulses import LossForm

from .conftest import HOSTILE, HOSTILE_NOTE
from .reader import HEADINGS


def test_headings_go_down_one_level_at_a_time_from_a_single_first_one(read):
    levels = [HEADINGS.index(tag) + 1 for tag, _ in read.elements if tag in HEADINGS]
    assert levels.count(1) == 1
    assert levels[0] == 1
    assert all(b - a <= 1 for a, b in itertools.pairwise(levels))


def test_ids_are_unique_and_every_link_leads_to_one(read):
    ids = Counter(attributes["id"] for _, attributes in read.elements if "id" in attributes)
    assert max(ids.values()) == 1
    links = [attributes["href"].removeprefix("#") for attributes in read.find("a")]
    named = [attributes.get("aria-labelledby") for _, attributes in read.elements]
    assert set(links) | set(filter(None, named)) <= set(ids)


def test_tables_have_a_caption_a_head_and_cells_that_say_what_they_head(read):
    tables = read.find("table")
    assert len(tables) == len(read.find("caption")) == len(read.find("thead")) > 10
    assert all(cell.get("scope") in ("col", "row") for cell in read.find("th"))
    for caption, rows in zip(read.captions, read.tables, strict=True):
        assert caption
        assert len({len(row) for row in rows}) == 1, caption
        assert len(rows) > 1, caption


def test_the_page_loads_nothing_and_runs_nothing(read, page):
    assert not {"script", "iframe", "object", "embed"} & {tag for tag, _ in read.elements}
    for tag, attributes in read.elements:
        for name, value in attributes.items():
            assert not name.startswith("on")
            if tag == "img" and name == "src":
                assert (value or "").startswith("data:image/svg+xml;base64,")
            else:
                assert not re.search(r"(https?:)?//", value or ""), (tag, name)
    (style,) = re.findall(r"<style>(.*?)</style>", page, re.DOTALL)
    assert "url(" not in style
    assert "@import" not in style


def test_its_language_and_the_way_past_the_contents_are_named(read):
    assert read.find("html") == [{"lang": "en"}]
    assert {"class": "skip", "href": "#report"} in read.find("a")
    assert read.find("main") == [{"id": "report"}]


def test_names_and_notes_of_files_are_text_and_nothing_else(read, page):
    assert HOSTILE in read.text
    assert HOSTILE_NOTE in read.text
    assert "<script" not in page
    assert 'evil.example/x.png"' not in page


def test_the_method_knows_who_wrote_of_each_form_of_loss():
    method = Path(impact_rig.__file__).parent / "present/report/templates/method.html.jinja"
    text = method.read_text(encoding="utf-8")
    assert [form for form in LossForm if f'"{form.value}"' not in text] == [LossForm.LINEAR]


def test_the_templates_are_installed_with_the_package():
    root = Path(__file__).parents[3]
    (pattern,) = re.findall(r"present/report/templates/\*", (root / "setup.py").read_text())
    assert list((root / "impact_rig").glob(pattern))
