"""A picture is drawn alike on every machine, and whatever its texts are."""

import base64
import xml.etree.ElementTree as ET

import matplotlib as mpl
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.present.picture import make_panel, make_picture, shorten_name

HOSTILE = '<script>alert("a")</script> & $x_1$'
HEAD = "data:image/svg+xml;base64,"


def draw():
    panel = make_panel(2.0)
    panel.axes[0].plot([0, 1], [1, 2], label=HOSTILE)
    panel.legend()
    return panel


def read_svg(url):
    return ET.fromstring(base64.b64decode(url.removeprefix(HEAD)))


def test_a_panel_is_an_image_that_needs_nothing_else_and_its_texts_are_text():
    (panel,) = make_picture("title", "caption", [draw]).panels
    assert panel.startswith(HEAD)
    elements = list(read_svg(panel).iter())
    assert HOSTILE in {"".join(item.itertext()) for item in elements if item.tag.endswith("text")}
    assert not any(item.tag.endswith("script") for item in elements)


def test_the_same_drawing_gives_the_same_characters_whatever_the_user_s_matplotlib():
    picture = make_picture("title", "caption", [draw])
    with mpl.rc_context({"font.size": 30.0, "lines.linewidth": 9.0, "svg.fonttype": "path"}):
        assert make_picture("title", "caption", [draw]) == picture
        assert mpl.rcParams["font.size"] == 30.0


@given(st.text())
def test_a_short_name_fits_and_is_something_that_xml_can_hold(name):
    short = shorten_name(name)
    assert len(short) <= 20
    element = ET.Element("text")
    element.text = short
    assert (ET.fromstring(ET.tostring(element)).text or "") == short
