"""Every tab, drawn by a viewer without a screen: no view complains, each plot has ink."""

import io
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from impact_rig.page.states import Level, NodeHealth
from impact_rig.present.rerun.blueprint import (
    TAB_CAMPAIGN,
    TAB_HEALTH,
    TAB_HIT,
    TAB_SAMPLE,
)
from impact_rig.present.rerun.entities import HIT, HIT_TIME, WALL_CLOCK
from impact_rig.present.rerun.viewers import find_free_port
from impact_rig.results import palette

experimental = pytest.importorskip("rerun.experimental", reason="rerun-sdk is not installed")
PATIENCE = 60.0
"""How long a picture may take on a busy machine without a graphics card [s]."""
WIDTH, HEIGHT = 1280, 800
LEAST_INK = 40
"""Pixels that a colour must have in a view."""
LEAST_TEXT = 200
"""Bright pixels of a text."""
COLOUR_DISTANCE = 40
"""How far a drawn colour may be from the ordered one, per channel: lines have soft edges."""
DRIVER_MISSING = ("No graphics adapter was found", "Failed to get render context")
"""What a viewer says where there is no driver at all, and where there is one for OpenGL only."""
NO_DRIVER = "no Vulkan driver: on Debian, apt-get install mesa-vulkan-drivers"


def insist(ask):
    """Ask a viewer until it answers: on a busy machine it may be late."""
    deadline = time.monotonic() + PATIENCE
    while True:
        try:
            return ask()
        except OSError:
            if time.monotonic() > deadline:
                raise


class Viewer:
    """A viewer that draws into memory, and shows one recording."""

    def __init__(self, client, process):
        self.client = client
        self._process = process

    def show(self, *path, timeline):
        """Bring a tab to the front, and one of its tabs, as a user would.

        Return the views on screen: their ids by name.
        """
        blueprint = insist(lambda: self.client.get_blueprint("recording").blueprint)
        blueprint["/time_panel"]["TimePanelBlueprint"]["timeline"] = timeline
        root = blueprint["/viewport"]["ViewportBlueprint"]["root_container"]
        views = self._find_views(blueprint, f"/container/{root}", list(path))
        insist(lambda: self.client.set_blueprint(blueprint, "recording"))
        return views

    def _find_views(self, blueprint, node, path):
        if "ViewBlueprint" in blueprint[node]:
            return {blueprint[node]["ViewBlueprint"]["display_name"]: node.rpartition("/")[2]}
        container = blueprint[node]["ContainerBlueprint"]
        children = [f"/{child.lstrip('/')}" for child in container["contents"]]
        container["contents"] = [child[1:] for child in children]
        if container["container_kind"] == "Tabs":
            wanted = path.pop(0) if path else None
            children = [
                child
                for child in children
                if blueprint[child]["ContainerBlueprint"]["display_name"] == wanted
            ] or children[:1]
            container["active_tab"] = children[0][1:]
        views = {}
        for child in children:
            views |= self._find_views(blueprint, child, path)
        return views

    def draw(self, view_id):
        """Return the picture of a view, shape (height, width, 3); None: it is not there yet."""
        from PIL import Image

        try:
            picture = Image.open(io.BytesIO(self.client.take_screenshot(view_id)))
        except OSError:
            return None
        return np.asarray(picture.convert("RGB")).astype(int)

    def close(self):
        os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()


def start_viewer(path):
    port = find_free_port()
    command = ["--headless", "--window-size", f"{WIDTH}x{HEIGHT}", "--bind", "127.0.0.1"]
    said = path.with_suffix(".txt")
    with said.open("w") as output:
        process = subprocess.Popen(
            [sys.executable, "-m", "rerun", *command, "--port", str(port)],
            stdout=output,
            stderr=output,
            start_new_session=True,
        )
    deadline = time.monotonic() + PATIENCE
    while True:
        try:
            client = experimental.ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            client.open(str(path))
            return Viewer(client, process)
        except (OSError, RuntimeError):
            if process.poll() is not None:
                text = said.read_text()
                if any(words in text for words in DRIVER_MISSING):
                    pytest.skip(NO_DRIVER)
                raise AssertionError(text) from None
            assert time.monotonic() < deadline, "the viewer does not answer"


@pytest.fixture(scope="module")
def viewer(campaign, contacts, write_view, tmp_path_factory):
    """Return a viewer that shows a campaign and a rig's health."""
    nodes = (
        NodeHealth("hammer", Level.OK, "active", (("armed", "True"),)),
        NodeHealth("estimator", Level.WARNING, "gaps", (("gaps", "3"),)),
        NodeHealth("recorder", Level.ERROR, "disk full", (("size", "31000000000"),)),
    )
    start = campaign.hits[0].stamp
    path = tmp_path_factory.mktemp("view") / "view.rrd"
    write_view(
        path,
        lambda log: log.log_campaign(campaign),
        lambda log: log.log_sample(
            contacts.samples[1], contacts.results.samples[1].contact_law, contacts.results.setup
        ),
        *(lambda log, i=i: log.log_health(nodes, start + i) for i in (0, 10**9)),
    )
    viewer = start_viewer(path)
    yield viewer
    viewer.close()


def count_ink(pixels, colour):
    return int((np.abs(pixels - np.array(colour)).max(axis=-1) < COLOUR_DISTANCE).sum())


def find_blank(pixels, colours):
    """Return what should be drawn and is not; None stands for text, on dark ground."""
    if pixels is None:
        return "not on screen"
    return [
        colour
        for colour in colours
        if (
            count_ink(pixels, colour) < LEAST_INK
            if colour is not None
            else (pixels.min(axis=-1) > 150).sum() < LEAST_TEXT
        )
    ]


SAMPLES = ("aluminium small", "brass large")
BOTH = (palette.HAMMER, palette.SPECIMEN)
MODELS = (palette.SPECIMEN_MODEL, palette.GREY)
WALL = f"(timeline {WALL_CLOCK})"
EACH_HIT = f"of each hit (timeline {HIT} or {WALL_CLOCK}, chosen below)"


@pytest.mark.parametrize(
    ("path", "timeline", "expected"),
    [
        (
            (TAB_HIT,),
            HIT_TIME,
            {
                "Measured acceleration [m/s²] over the time in the record": BOTH,
                "Verdict": (None,),
            },
        ),
        (
            (TAB_SAMPLE,),
            HIT_TIME,
            dict.fromkeys(SAMPLES, (*BOTH, *MODELS, palette.CONTACT)),
        ),
        (
            (TAB_SAMPLE, "steel medium"),
            HIT_TIME,
            {
                "hammer of steel medium [m/s²]": (palette.HAMMER, palette.CONTACT),
                "sample of steel medium [m/s²]": (palette.SPECIMEN, *MODELS, palette.CONTACT),
                "Force on the hammer of steel medium [N]": (palette.BLUE, palette.VERMILION),
                "Residual of law and versed-sine of steel medium [N]": (palette.VERMILION,),
                "Results": (None,),
            },
        ),
        (
            (TAB_CAMPAIGN,),
            HIT,
            {
                "Measured and expected": (None,),
                "Verdicts": (None,),
                f"Contact time τp [µs] {EACH_HIT}": (palette.CONTACT,),
                f"Peak of the sample [m/s²] {EACH_HIT}": (palette.SPECIMEN,),
            },
        ),
        (
            (TAB_HEALTH,),
            WALL_CLOCK,
            {
                "Nodes": (None,),
                f"State of the nodes {WALL}": (None,),
                f"Gaps, missing points, dropped, rejected {WALL}": (None,),
            },
        ),
    ],
    ids=lambda item: {tuple: "/".join, str: str, dict: lambda _: "drawn"}[type(item)](item),
)
def test_a_tab_is_drawn(viewer, path, timeline, expected):
    views = viewer.show(*path, timeline=timeline)

    assert expected.keys() <= views.keys()
    deadline = time.monotonic() + PATIENCE
    for name, colours in expected.items():
        while blank := find_blank(viewer.draw(views[name]), colours):
            assert time.monotonic() < deadline, f"{name}: {blank}"
    state = insist(viewer.client.get_state)
    assert [(view.name, report) for view in state.views for report in view.reports] == []
