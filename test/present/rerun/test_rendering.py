"""Every tab as it opens, drawn by a viewer without a screen: no view complains, none is blank."""

import io
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.present.rerun.blueprint import TAB_CAMPAIGN, TAB_HIT, TAB_SAMPLE
from impact_rig.present.rerun.viewers import find_free_port
from impact_rig.results import palette

experimental = pytest.importorskip("rerun.experimental", reason="rerun-sdk is not installed")
PATIENCE = 60.0
"""How long a picture may take on a busy machine without a graphics card [s]."""
WIDTH, HEIGHT = 1280, 800
LEAST_INK = 40
"""Pixels that a colour must have in a view."""
LEAST_TEXT = 40
"""Bright pixels of a text: less than those of two words."""
LEAST_WIDTH = 0.15
"""Part of a plot's width that a trace or points take at least."""
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

    def show(self, *path):
        """Bring a tab to the front, and one of its tabs, as a user would.

        Return the views on screen: their ids by name.
        """
        blueprint = insist(lambda: self.client.get_blueprint("recording").blueprint)
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
def open_viewer(write_view, tmp_path_factory):
    """Return a function that opens a viewer of what is logged."""
    viewers = []

    def run(*works):
        path = tmp_path_factory.mktemp("view") / "view.rrd"
        write_view(path, *works)
        viewers.append(start_viewer(path))
        return viewers[-1]

    yield run
    for viewer in viewers:
        viewer.close()


@pytest.fixture(scope="module")
def viewer(open_viewer, campaign, contacts):
    """Return a viewer of a recording: a sample has a law, the others have none."""
    law = contacts.results.samples[1].contact_law
    return open_viewer(
        lambda log: log.log_campaign(campaign),
        lambda log: log.log_sample(contacts.samples[1], law, contacts.results.setup),
    )


@pytest.fixture(scope="module")
def early_viewer(open_viewer):
    """Return a viewer of a rig before its first hit."""
    times = [sample.reference_contact_time for sample in PAPER_SETUP.samples.samples]
    return open_viewer(lambda log: log.log_setup("rig", PAPER_SETUP.samples.names, times))


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


def check_tab(viewer, path, expected):
    """Check that a tab has these views and no other, and that each shows what it should."""
    views = viewer.show(*path)
    assert views.keys() == expected.keys()
    deadline = time.monotonic() + PATIENCE
    for name, colours in expected.items():
        if not colours:  # laid out by the same loop as another
            continue
        while blank := find_blank(viewer.draw(views[name]), colours):
            assert time.monotonic() < deadline, f"{name}: {blank}"
    state = insist(viewer.client.get_state)
    assert [(view.name, report) for view in state.views for report in view.reports] == []


BOTH = (palette.HAMMER, palette.SPECIMEN)
MODELS = (palette.SPECIMEN_MODEL, palette.GREY)
TEXT, SENTENCE = (None,), (palette.GREY,)
RECORD = "Measured acceleration [m/s²] over the time in the record"
EACH_HIT = "of each hit (7 s: record 7; grey: rejected)"
TABLES = dict.fromkeys(("Measured and expected", "Verdicts"), TEXT)


def list_sample_views(sample, hammer, specimen, law, residual):
    return {
        f"hammer of {sample} [m/s²]": hammer,
        f"sample of {sample} [m/s²]": specimen,
        f"Force on the hammer of {sample} [N]": law,
        f"Residual of {sample} [N]": residual,
        "Results": TEXT,
    }


def list_overview(colours):
    """Return the views of all samples, of which the first and the last are looked at."""
    first, *others, last = PAPER_SETUP.samples.names
    return {first: colours, **dict.fromkeys(others, ()), last: colours}


def list_trends(*colours):
    names = ("Contact time τp [µs]", "Peak of the hammer [m/s²]", "Peak of the sample [m/s²]")
    return {f"{name} {EACH_HIT}": (colour,) for name, colour in zip(names, colours, strict=True)}


TRACES = (palette.HAMMER, palette.CONTACT), (palette.SPECIMEN, *MODELS, palette.CONTACT)


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ((TAB_HIT,), {RECORD: BOTH, "Verdict": TEXT}),
        ((TAB_SAMPLE,), list_overview((*BOTH, *MODELS, palette.CONTACT))),
        (
            (TAB_SAMPLE, "steel medium"),
            list_sample_views(
                "steel medium", *TRACES, (palette.BLUE, palette.VERMILION), (palette.VERMILION,)
            ),
        ),
        (
            (TAB_SAMPLE, "steel large"),
            list_sample_views("steel large", *TRACES, SENTENCE, SENTENCE),
        ),
        ((TAB_CAMPAIGN,), TABLES | list_trends(palette.CONTACT, palette.HAMMER, palette.SPECIMEN)),
    ],
    ids=["hit", "all samples", "with a law", "without a law", "campaign"],
)
def test_a_recording_s_tab_is_drawn(viewer, path, expected):
    check_tab(viewer, path, expected)


def measure_width(pixels, colour):
    """Return over which part of a view's width a colour lies: of a legend's dot it is small."""
    if pixels is None:
        return 0.0
    return float((np.abs(pixels - np.array(colour)).max(axis=-1) < COLOUR_DISTANCE).any(0).mean())


@pytest.mark.parametrize(
    ("path", "name", "colour"),
    [
        ((TAB_HIT,), RECORD, palette.SPECIMEN),
        ((TAB_SAMPLE, "steel medium"), "Force on the hammer of steel medium [N]", palette.BLUE),
        ((TAB_CAMPAIGN,), f"Contact time τp [µs] {EACH_HIT}", palette.CONTACT),
    ],
    ids=["hit", "law", "trend"],
)
def test_lines_are_as_wide_as_their_plot(viewer, path, name, colour):
    view = viewer.show(*path)[name]
    deadline = time.monotonic() + PATIENCE
    while (width := measure_width(viewer.draw(view), colour)) < LEAST_WIDTH:
        assert time.monotonic() < deadline, width


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ((TAB_HIT,), {RECORD: SENTENCE, "Verdict": TEXT}),
        ((TAB_SAMPLE,), list_overview(SENTENCE)),
        ((TAB_SAMPLE, "steel medium"), list_sample_views("steel medium", *[SENTENCE] * 4)),
        ((TAB_CAMPAIGN,), TABLES | list_trends(*[palette.GREY] * 3)),
    ],
    ids=["hit", "all samples", "a sample", "campaign"],
)
def test_before_the_first_hit_no_tab_is_blank(early_viewer, path, expected):
    check_tab(early_viewer, path, expected)
