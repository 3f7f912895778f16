"""A picture is drawn alike on every machine, and whatever its texts are."""

import base64
import xml.etree.ElementTree as ET

import matplotlib as mpl
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.present.picture import drawing_style, make_picture, reuse_panel, shorten_name

HOSTILE = '<script>alert("a")</script> & $x_1$'
HEAD = "data:image/svg+xml;base64,"


def draw(label=HOSTILE):
    with drawing_style():
        panel = reuse_panel(2.0)
        panel.axes[0].errorbar([0, 1], [1, 2], yerr=[1, 1], color="red", label=label)
        panel.axes[0].bar([0], [1], color="red")
        if label != HOSTILE:
            panel.axes[0].set(title=label, ylim=(0.0, 9.0))
        panel.legend()
        return make_picture("title", "caption", [panel])


def read_svg(url):
    return ET.fromstring(base64.b64decode(url.removeprefix(HEAD)))


def test_a_panel_is_an_image_that_needs_nothing_else_and_its_texts_are_text():
    (panel,) = draw().panels
    assert panel.url.startswith(HEAD)
    elements = list(read_svg(panel.url).iter())
    assert HOSTILE in {"".join(item.itertext()) for item in elements if item.tag.endswith("text")}
    assert not any(item.tag.endswith("script") for item in elements)


def test_the_same_drawing_gives_the_same_characters_whatever_was_drawn_before():
    picture = draw()
    with mpl.rc_context({"font.size": 30.0, "lines.linewidth": 9.0, "svg.fonttype": "path"}):
        assert draw("other") != picture
        assert draw() == picture
        assert mpl.rcParams["font.size"] == 30.0


@given(st.text())
def test_a_short_name_fits_and_is_something_that_xml_can_hold(name):
    short = shorten_name(name)
    assert len(short) <= 20
    element = ET.Element("text")
    element.text = short
    assert (ET.fromstring(ET.tostring(element)).text or "") == short
