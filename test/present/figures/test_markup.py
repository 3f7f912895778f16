import re
from dataclasses import replace
from xml.etree import ElementTree as ET

import matplotlib as mpl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.present.figures.markup import make_name
from impact_rig.present.figures.paper_figures import draw_figure_3
from impact_rig.present.figures.sample_figure import draw_sample_figure
from impact_rig.results.figure_rows import make_figure_rows

HOSTILE = '<script>alert("a")</script> & $x_1$'


def draw(struck):
    return draw_sample_figure(
        struck.results.samples[0],
        struck.samples[0],
        [hit.aligned for hit in struck.hits],
    )


@pytest.fixture(scope="module")
def figure(struck):
    return draw(struck)


def list_elements(figure):
    return list(ET.fromstring(figure.svg).iter())


def test_the_font_is_the_page_s_and_text_is_text(figure):
    assert "font-family" not in figure.svg
    texts = {"".join(e.itertext()) for e in list_elements(figure) if e.tag.endswith("}text")}
    assert {"a) hammer", "b) sample", "acceleration [m/s²]", "U1", "U2"} <= texts


def test_ids_are_the_figure_s_own_and_every_reference_leads_somewhere(figure):
    elements = list_elements(figure)
    ids = [e.get("id") for e in elements if e.get("id")]
    assert len(set(ids)) == len(ids)
    assert all(identifier.startswith(f"{figure.name}-") for identifier in ids)
    references = [e.get("href", "").removeprefix("#") for e in elements if e.get("href")]
    references += re.findall(r"url\(#([^)]*)\)", figure.svg)
    assert references
    assert set(references) <= set(ids)


def test_nothing_is_loaded_and_nothing_reaches_beyond_the_figure(figure):
    tags = {e.tag.rpartition("}")[2] for e in list_elements(figure)}
    assert tags <= {"div", "svg", "g", "defs", "clipPath", "rect", "path", "use", "text", "tspan"}
    assert not re.search(r"https?:", figure.svg.replace("http://www.w3.org/2000/svg", ""))
    assert not re.search(r"url\((?!#)", figure.svg)


def test_it_is_one_element_without_prolog_that_html_takes(figure):
    assert figure.svg.startswith("<div ")
    assert figure.svg.endswith("</div>")
    assert not re.search(r"<[?!]", figure.svg)


def test_the_same_results_give_the_same_characters_whatever_the_user_s_matplotlib(struck, figure):
    with mpl.rc_context({"font.size": 30.0, "lines.linewidth": 9.0, "svg.fonttype": "path"}):
        assert draw(struck) == figure
        assert mpl.rcParams["font.size"] == 30.0


def test_two_campaigns_on_one_page_share_no_id(struck, figure):
    other = figure.rename("other")
    assert not re.search(rf"[\"#]{figure.name}-", other)
    assert (
        other.replace('"other-', f'"{figure.name}-').replace("#other-", f"#{figure.name}-")
        == figure.svg
    )


def test_a_name_is_only_ever_text(struck, read):
    row = make_figure_rows(struck.results)[0]
    figure = draw_figure_3([replace(row, name=HOSTILE[:20], material=HOSTILE[-18:])])
    assert "script" not in {e.tag.rpartition("}")[2] for e in list_elements(figure)}
    texts = [text for panel in read(figure) for text in panel.read_texts()]
    assert HOSTILE[:20] in texts
    assert HOSTILE[-18:] in texts  # nor is it a formula


names = st.text(min_size=1, max_size=40)


@given(names)
def test_a_name_is_fit_for_ids_and_files_on_every_system(name):
    assert re.fullmatch(r"[A-Za-z0-9_-]+", make_name("sample", name))


@given(st.lists(names, min_size=2, max_size=2, unique=True))
def test_different_samples_have_different_names(pair):
    assert make_name("sample", pair[0]) != make_name("sample", pair[1])
