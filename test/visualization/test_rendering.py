"""Every tab, drawn by a viewer without a screen: no view complains, each plot has ink."""

import io
import itertools
import socket
import time

import numpy as np
import pytest

from impact_rig.core.setup.paper import PAPER_SETUP, PUBLISHED_SAMPLES
from impact_rig.core.signals.record import HitLabel
from impact_rig.results.hit_traces import HitTraces
from impact_rig.visualization import entities, log
from impact_rig.visualization.blueprint import (
    TAB_LAST_HIT,
    TAB_PRINTED,
    TAB_RESULTS,
    TAB_SAMPLES,
    make_blueprint,
)
from impact_rig.visualization.destinations import open_destinations
from impact_rig.visualization.log import ComparisonTraces
from impact_rig.visualization.text import EstimateRow, EstimateTable, Quantity, Verdict

experimental = pytest.importorskip("rerun.experimental", reason="rerun-sdk is not installed")
PATIENCE = 20.0
LEAST_INK = 400
"""Pixels that a colour must have."""
TIME = np.arange(5000) / 2.5e6
PRE_TRIGGER = 0.2e-3
COLOUR_DISTANCE = 40
"""How far a drawn colour may be from the ordered one, per channel: lines have soft edges."""


def make_traces(contact_time):
    """Return a versed-sine and a decaying oscillation after it, of unit peak."""
    late = TIME - PRE_TRIGGER
    inside = (late >= 0) & (late <= contact_time)
    pulse = np.where(inside, np.sin(np.pi * late / contact_time) ** 2, 0.0)
    ringing = np.clip(late - contact_time / 2, 0.0, None)
    decay = np.exp(-ringing / 2e-4) * np.cos(2 * np.pi * ringing / (2 * contact_time))
    return pulse, np.where(late < contact_time / 2, pulse, decay)


def log_campaign(path):
    (destination,) = open_destinations(output=str(path), notify=print)
    names = PAPER_SETUP.samples.names
    destination.put(lambda log: log.log_setup("paper", names))
    for i in (1, 2):
        hammer, specimen = make_traces(170e-6)
        values = np.stack([800 * hammer, 1500 * specimen], axis=1).astype(np.float32)
        hit = HitTraces(HitLabel("steel small", record=i, impact=i), TIME, values)
        verdict = Verdict(hit.label, i == 1, () if i == 1 else ("weak: too weak",), 170e-6)
        destination.put(lambda log, hit=hit: log.log_hit(hit))
        destination.put(lambda log, verdict=verdict: log.log_verdict(verdict, 10**18))
    rows = []
    for cell in PUBLISHED_SAMPLES:
        hammer, specimen = make_traces(cell.contact_time)
        for model in (entities.DRIVEN, entities.PRINTED):
            comparison = ComparisonTraces(
                sample=cell.name,
                model=model,
                time=TIME - PRE_TRIGGER,
                hammer_measured=hammer,
                hammer_model=np.roll(0.9 * hammer, 60),
                specimen_measured=specimen,
                specimen_model=np.roll(0.9 * specimen, 60),
                contact_time=cell.contact_time,
                mse_hammer_percent=0.1,
                mse_sample_percent=1.0,
            )
            destination.put(lambda log, item=comparison: log.log_comparison(item))
        quantity = Quantity(cell.contact_time, cell.contact_time)
        rows.append(EstimateRow(cell.name, 10, 0, quantity))
    destination.put(lambda log: log.log_estimates(EstimateTable(tuple(rows))))
    destination.close()


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
            if count_ink(cell, entities.SPECIMEN_COLOUR) < LEAST_INK // 4:
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
        (TAB_LAST_HIT, (entities.HAMMER_COLOUR, entities.SPECIMEN_COLOUR)),
        (
            TAB_SAMPLES,
            (
                entities.HAMMER_COLOUR,
                entities.HAMMER_MODEL_COLOUR,
                entities.SPECIMEN_COLOUR,
                entities.SPECIMEN_MODEL_COLOUR,
            ),
        ),
        (TAB_PRINTED, (entities.HAMMER_MODEL_COLOUR, entities.SPECIMEN_MODEL_COLOUR)),
        (TAB_RESULTS, ()),
    ],
)
def test_a_tab_is_drawn(viewer, tab, colours, tmp_path, monkeypatch):
    monkeypatch.setattr(log, "make_blueprint", lambda names: make_blueprint(names, tab))
    path = tmp_path / "view.rrd"
    log_campaign(path)

    viewer.open(str(path))
    deadline = time.monotonic() + PATIENCE
    while blank := find_blank(draw(viewer), tab, colours):
        assert time.monotonic() < deadline, blank
    views = viewer.get_state().views
    assert [(view.name, report) for view in views for report in view.reports] == []
