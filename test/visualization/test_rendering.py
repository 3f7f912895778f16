"""Every tab, drawn by a viewer without a screen: no view complains, each plot has ink."""

import io
import itertools
import socket
import time

import numpy as np
import pytest

from impact_rig.results import palette
from impact_rig.visualization import log
from impact_rig.visualization.blueprint import (
    TAB_LAST_HIT,
    TAB_PRINTED,
    TAB_RESULTS,
    TAB_SAMPLES,
    make_blueprint,
)

experimental = pytest.importorskip("rerun.experimental", reason="rerun-sdk is not installed")
PATIENCE = 20.0
LEAST_INK = 400
"""Pixels that a colour must have."""
COLOUR_DISTANCE = 40
"""How far a drawn colour may be from the ordered one, per channel: lines have soft edges."""


@pytest.fixture
def viewer():
    """Start a viewer that draws into memory."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    client = experimental.ViewerClient.spawn(headless=True, port=port)
    try:
        client.get_state()
    except ConnectionError:
        client.quit()
        pytest.skip("no graphics driver: on Debian, apt-get install mesa-vulkan-drivers")
    yield client
    client.quit()


def draw(viewer):
    """Return the viewer's picture, shape (height, width, 3)."""
    from PIL import Image

    picture = Image.open(io.BytesIO(viewer.take_screenshot()))
    return np.asarray(picture.convert("RGB")).astype(int)


def find_blank(pixels, tab, colours):
    """Return what should be drawn and is not."""
    blank = [f"colour {colour}" for colour in colours if count_ink(pixels, colour) < LEAST_INK]
    height, width, _ = pixels.shape
    if tab in (TAB_SAMPLES, TAB_PRINTED):
        # One plot per sample, in four columns and three rows.
        for row, column in itertools.product(range(3), range(4)):
            cell = pixels[
                row * height // 3 : (row + 1) * height // 3,
                column * width // 4 : (column + 1) * width // 4,
            ]
            if count_ink(cell, palette.SPECIMEN) < LEAST_INK // 4:
                blank.append(f"plot in row {row}, column {column}")
    if tab == TAB_RESULTS:
        # Text on dark ground: the table above, the log below.
        bright = pixels.min(axis=-1) > 150
        if bright[: height // 2].sum() < 3000:
            blank.append("table")
        if bright[height // 2 :].sum() < 500:
            blank.append("log")
    return blank


def count_ink(pixels, colour):
    return int((np.abs(pixels - np.array(colour)).max(axis=-1) < COLOUR_DISTANCE).sum())


@pytest.mark.parametrize(
    ("tab", "colours"),
    [
        (TAB_LAST_HIT, (palette.HAMMER, palette.SPECIMEN)),
        (
            TAB_SAMPLES,
            (
                palette.HAMMER,
                palette.HAMMER_MODEL,
                palette.SPECIMEN,
                palette.SPECIMEN_MODEL,
            ),
        ),
        (TAB_PRINTED, (palette.HAMMER_MODEL, palette.SPECIMEN_MODEL)),
        (TAB_RESULTS, ()),
    ],
)
def test_a_tab_is_drawn(viewer, tab, colours, campaign, write_view, tmp_path, monkeypatch):
    monkeypatch.setattr(log, "make_blueprint", lambda names: make_blueprint(names, tab))
    path = tmp_path / "view.rrd"
    write_view(path, lambda log: log.log_campaign(campaign))

    viewer.open(str(path))
    deadline = time.monotonic() + PATIENCE
    while blank := find_blank(draw(viewer), tab, colours):
        assert time.monotonic() < deadline, blank
    views = viewer.get_state().views
    assert [(view.name, report) for view in views for report in view.reports] == []
