"""Campaigns of the virtual rig, recorded without running nodes, and a way to call commands."""

import contextlib
import itertools
import math
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from impact_rig.cli.main import cli
from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.core.session import Session
from impact_rig.devices.virtual.rig import FaultPlan, VirtualRig, VirtualRigSettings
from impact_rig.results.campaign import Results, results_from_session

PATIENCE = 100.0
"""How long a command may take before a test fails [s]."""


@dataclass(frozen=True)
class Outcome:
    """How a command ended and what it printed."""

    exit_code: int
    stdout: str
    stderr: str


@pytest.fixture
def run(capsys, monkeypatch):
    """Return a function that calls `impact-rig` with arguments, on a terminal of 80 columns."""
    monkeypatch.setenv("COLUMNS", "80")

    def call(*words):
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            cli([str(word) for word in words], prog_name="impact-rig")
        return Outcome(int(end.value.code or 0), *capsys.readouterr())

    return call


@pytest.fixture
def channels(tmp_path):
    """Return a function that writes a file of channels and returns the option that names it."""

    def write(text):
        path = tmp_path / "channels.toml"
        path.write_text(text, "utf-8")
        return "--channels", path

    return write


def start_command(*words, **options):
    """Start `impact-rig` as a process; pipes and environment may be replaced."""
    return start_python("-m", "impact_rig.cli.main", *words, **options)


def start_python(*words, env=None, **options):
    """Start Python; `env` replaces variables of the environment, None takes one away."""
    variables = {**os.environ, **(env or {})}
    return subprocess.Popen(
        [sys.executable, *map(str, words)],
        env={name: value for name, value in variables.items() if value is not None},
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **options},
    )


def finish(process):
    """Wait for the end; return exit code, output and errors."""
    output, errors = process.communicate(timeout=PATIENCE)
    return process.returncode, output, errors


@dataclass(frozen=True)
class RecordedCampaign:
    """A recording and what the session of the live run found."""

    path: Path
    results: Results


def record_campaigns(path, settings, samples, impacts, *, setup=PAPER_SETUP, campaigns=1):
    """Strike and record; return the results of the last campaign."""
    from impact_rig.nodes import interfaces, messages

    from ..nodes.replays import write_recording

    rig, record = VirtualRig(setup, settings), 0
    stamp = messages.stamp_to_msg(1_700_000_000_000_000_000)
    told = [(interfaces.SETUP, messages.setup_to_msg(setup, stamp))]  # the campaign node comes up
    for _ in range(campaigns):
        told.append((interfaces.SETUP, messages.setup_to_msg(setup, stamp)))
        session, faults = Session(setup), {}
        for name in samples:
            accepted = attempt = 0
            while accepted < impacts:
                record, attempt = record + 1, attempt + 1
                hit = rig.strike(HitLabel(name, record, accepted + 1, attempt))
                faults[record] = tuple(fault.value for fault in hit.faults)
                told.append((interfaces.VIRTUAL_IMPACT, messages.virtual_hit_to_msg(hit, stamp)))
                for block in hit.split(1000, 0):
                    told.append((interfaces.ACCELERATION, messages.block_to_msg(block)))
                    for judged in session.feed(block):
                        if judged.accepted:
                            accepted, attempt = accepted + 1, 0
    write_recording(path, [(number * 1e-3, *item) for number, item in enumerate(told)])
    return RecordedCampaign(path, results_from_session(session.estimate_all(), faults))


STRUCK = ("aluminium large", "steel small", "brass medium")
"""The control sample and the paper's misprint are among them."""
HIT_SIZE = 40_000
"""Of the blocks of a hit [byte], nearly."""


@pytest.fixture(scope="session")
def campaign(tmp_path_factory):
    """Return a campaign on three of the paper's samples, recorded, with faults."""
    folder = tmp_path_factory.mktemp("run")
    settings = VirtualRigSettings(seed=7, faults=FaultPlan(0.1))
    return record_campaigns(folder / "session.mcap", settings, STRUCK, 3)


@pytest.fixture(scope="session")
def struck(tmp_path_factory):
    """Return a recording of four samples, three hits each, the last one rejected: no estimates.

    Nearly one chunk for each hit, as the recorder writes them.
    """
    from impact_rig_msgs.msg import Finding, HammerRelease, Impact, RecordStored

    from impact_rig.nodes import interfaces, messages

    from ..nodes.replays import write_recording

    path = tmp_path_factory.mktemp("struck") / "session.mcap"
    rig = VirtualRig(PAPER_SETUP, VirtualRigSettings(seed=5))
    stamp = messages.stamp_to_msg(1_700_000_000_000_000_000)
    told = [(interfaces.SETUP, messages.setup_to_msg(PAPER_SETUP, stamp))]
    names = PAPER_SETUP.samples.names[:4]
    for record, (name, impact) in enumerate(itertools.product(names, (1, 2, 3)), start=1):
        label = {"record": record, "sample": name, "impact": impact, "attempt": 1}
        blocks = rig.strike(HitLabel(**label)).split(1000, 0)
        weak = Finding(reason="weak", explanation="3 % of full scale")
        reasons = [weak] if impact == 3 else []
        verdict = Impact(accepted=not reasons, reasons=reasons, contact_time=math.nan, **label)
        told += [
            (interfaces.RELEASE, HammerRelease(**label)),
            *((interfaces.ACCELERATION, messages.block_to_msg(block)) for block in blocks),
            (interfaces.RECORD_STORED, RecordStored(blocks=len(blocks), **label)),
            (interfaces.IMPACT, verdict),
        ]
    events = [(number * 1e-3, *item) for number, item in enumerate(told)]
    return write_recording(path, events, chunk_size=HIT_SIZE)


@pytest.fixture(scope="session")
def record():
    """Return the function that strikes and records."""
    return record_campaigns


@pytest.fixture
def open_page(rig, browser):
    """Return a function that opens the page in a browser of its own."""
    with contextlib.ExitStack() as opened:

        def open_one(**options):
            context = browser.new_context(**options)
            opened.callback(context.close)
            context.set_default_timeout(40_000)
            page = context.new_page()
            page.goto(rig.link)
            return page

        yield open_one


@pytest.fixture
def page(open_page, rig):
    """Return the page of a rig in which no campaign runs, before and after."""
    from playwright.sync_api import expect

    shown = open_page()
    expect(shown.locator("#start form")).to_be_visible(timeout=40_000)
    yield shown
    # It may end by itself meanwhile.
    shown.evaluate("document.querySelector('form[action=end]')?.requestSubmit()")
    rig.do("reset")
    # One that stood still is not armed for a while.
    while not rig.do("arm"):
        rig.client.spin_until(lambda: False, 0.1)
    expect(shown.locator("#start form")).to_be_visible(timeout=40_000)
