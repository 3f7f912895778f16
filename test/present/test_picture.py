"""A picture is written alike on every machine, and whatever its texts and numbers are."""

import base64
import math
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.present.picture import (
    COLUMNS,
    MARKERS,
    TICK,
    Curve,
    Look,
    Panel,
    Plot,
    shorten_name,
    thin,
)
from impact_rig.present.svg import Axis, draw, embed

HOSTILE = '<script>alert("a")</script> & $x_1$'
HEAD = "data:image/svg+xml;base64,"
LINE = Look("#123456")


def make_panel(*curves, **options):
    return Panel((Plot(curves, 100.0, **options),))


def read_texts(panel):
    return ["".join(item.itertext()) for item in ET.fromstring(draw(panel)) if item.text]


def read_points(panel, colour=LINE.colour):
    """Return the corners of the one line in this colour, on the page."""
    (path,) = (
        item.get("d") for item in ET.fromstring(draw(panel)) if item.get("stroke") == colour
    )
    return [np.array(piece.split(), dtype=float).reshape(-1, 2) for piece in path.split("M")[1:]]


def test_a_panel_is_an_image_that_needs_nothing_else_and_its_texts_are_text():
    panel = make_panel(Curve([0, 1], [1, 2], LINE, HOSTILE), title=HOSTILE)
    url = embed(panel)
    assert url == embed(panel)
    elements = list(ET.fromstring(base64.b64decode(url.removeprefix(HEAD))).iter())
    assert {item.tag.partition("}")[2] for item in elements} == {"svg", "path", "text"}
    assert read_texts(panel).count(HOSTILE) == 2


def test_a_line_is_straight_where_its_values_are_and_breaks_where_one_is_missing():
    y = [0.0, 0.0, 0.0, 0.0, 3.0, math.nan, 0.0, 3.0]
    first, second = read_points(make_panel(Curve(np.arange(8.0), y, LINE)))
    assert [len(first), len(second)] == [3, 2]  # the corners
    assert first[1:] - first[1] == pytest.approx(second - second[0], abs=1.0)
    assert first[1, 0] - first[0, 0] == pytest.approx(3.0 * (second[1, 0] - second[0, 0]), abs=2.0)


@pytest.mark.parametrize("marker", [*MARKERS, TICK])
def test_every_marker_has_its_own_shape(marker):
    shapes = {}
    for name in (*MARKERS, TICK):
        curve = Curve([1.0], [2.0], Look(LINE.colour, width=0.0, marker=name))
        shapes[name] = read_shape(make_panel(curve))
    assert list(shapes.values()).count(shapes[marker]) == 1


def read_shape(panel):
    (shape,) = (
        item.get("d") for item in ET.fromstring(draw(panel)) if item.get("stroke") == LINE.colour
    )
    return shape


@given(st.floats(-1e9, 1e9), st.floats(1e-6, 1e3), st.floats(10.0, 60.0))
def test_ticks_are_round_in_order_and_far_enough_from_each_other(low, width, distance):
    axis = Axis(low, low + width * max(abs(low), 1.0), 0.0, 300.0)
    values, texts = zip(*axis.list_ticks(distance), strict=True)
    assert 300.0 / distance / 3.0 - 1.0 <= len(values) <= 300.0 / distance + 1.0
    assert len(set(texts)) == len(texts)
    read = [float(text.replace("\N{MINUS SIGN}", "-")) for text in texts]
    assert list(values) == pytest.approx(read)
    assert np.diff(axis.place(values)).min(initial=math.inf) > 0.99 * distance


@pytest.mark.parametrize("values", [[], [math.nan], [0.0, 0.0], [5.0], [1e9, 1e9], [-1e-9, 1e-9]])
@pytest.mark.parametrize("is_logarithmic", [False, True])
def test_there_is_a_panel_whatever_the_values_are(values, is_logarithmic):
    curve = Curve(values, values, Look(marker="o"), "name", y_bars=[1.0] * len(values))
    assert "nan" not in draw(make_panel(curve, is_logarithmic=is_logarithmic)).lower()


@given(st.integers(1, 5000))
def test_a_thinned_trace_keeps_its_extremes_and_has_two_points_a_column(count):
    values = np.random.default_rng(count).normal(size=count)
    places = thin(values)
    shown = values[: count // max(count // COLUMNS, 1) * max(count // COLUMNS, 1)]
    assert (values[places].min(), values[places].max()) == (shown.min(), shown.max())
    assert len(places) <= 4 * COLUMNS
    assert (np.diff(places) > 0).all()


@given(st.text())
def test_a_short_name_fits_and_is_something_that_xml_can_hold(name):
    short = shorten_name(name)
    assert len(short) <= 20
    element = ET.Element("text")
    element.text = short
    assert (ET.fromstring(ET.tostring(element)).text or "") == short
