"""A small campaign with everything there is to tell, and names that no page should trust."""

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from impact_rig.core.session import Session
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.setup.sensors import Sensor
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.choices import Fault, Plant
from impact_rig.devices.virtual.faults import FaultPlan, ScheduledFault
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.reporting.figures.figure import ReportFigure, make_missing_figure
from impact_rig.reporting.report import comparison_content, run_content
from impact_rig.reporting.report.page import render_page
from impact_rig.reporting.report.pdf import BROWSERS
from impact_rig.reporting.report.report import make_report
from impact_rig.results.flat_estimates import hit_results_from_judged, results_from_session
from impact_rig.results.hit_traces import TraceAssembler
from impact_rig.results.run import (
    Acquisition,
    ChannelCalibration,
    Note,
    Provenance,
    RecordedFile,
    Run,
)
from impact_rig.results.sample_traces import align_hit, sample_traces_from_estimate
from impact_rig.results.traced_campaign import TracedCampaign, TracedHit

from .browser import Browser
from .reader import Reader

HOSTILE = "<script>alert('sample')</script>--><b>"
"""A sample's name that would run, or end what it stands in, if it were not escaped."""
HOSTILE_NOTE = '</dd><img src="https://evil.example/x.png" onerror="alert(1)">'
START = 1_700_000_000_000_000_000
"""2023-11-14 22:13:20 UTC."""


def strike_run() -> Run:
    """Strike a control sample with a hostile name, and a misprinted one; lose one hit."""
    samples = PAPER_SETUP.samples
    renamed = (
        replace(samples.find("aluminium large"), name=HOSTILE),
        samples.find("brass medium"),
    )
    setup = replace(
        PAPER_SETUP,
        samples=replace(samples, samples=renamed, control_sample=HOSTILE),
        sensors=(
            Sensor("hammer", "force", "N", 2.25e-3, 2200.0, "<i>LW 7", "2022-03-01"),
            Sensor("specimen", "acceleration", "g", calibration_date="2023-03-01"),
        ),
    )
    weak = ScheduledFault(Fault.WEAK_HIT, 1, HOSTILE)
    settings = VirtualRigSettings(plant=Plant.DYNAMICS, faults=FaultPlan(scheduled=(weak,)))
    rig, session, assembler = VirtualRig(setup, settings), Session(setup), TraceAssembler()
    recorded, aligned, faults = {}, {}, {}
    labels = [(sample.name, impact) for sample in renamed for impact in (1, 2)]
    for record, (sample, impact) in enumerate([*labels, (HOSTILE, 3)], start=1):
        label = HitLabel(sample, record, impact)
        hit = rig.strike(label)
        faults[record] = tuple(fault.value for fault in hit.faults)
        for block in hit.split(5000, START):
            aligned |= {judged.label: align_hit(judged) for judged in session.feed(block)}
            if (traces := assembler.feed(block)) is not None:
                recorded[label] = traces
    found = session.estimate_all()
    hits = tuple(
        TracedHit(
            hit_results_from_judged(hit, faults[hit.label.record]),
            hit.stamp,
            recorded[hit.label],
            aligned[hit.label],
        )
        for hit in (*found.accepted, *found.rejected)
    )
    means = [
        sample_traces_from_estimate(estimate, session.find_mean(estimate.name))
        for estimate in found.samples
    ]
    return Run(
        name="before",
        source="before/session.mcap",
        campaign=TracedCampaign(results_from_session(found, faults), tuple(means), hits),
        has_traces=True,
        acquisitions=(
            Acquisition(
                2.5e6,
                (
                    ChannelCalibration("hammer", 0.9765625, 0.0, 2000.0, is_counted=True),
                    ChannelCalibration("sample", 1.953125, 0.25, 0.0, is_counted=False),
                ),
            ),
        ),
        provenance=Provenance(
            start_time=START,
            end_time=START + 12_300_000_000,
            files=(RecordedFile("session.mcap", 1_234_567, "ab" * 32),),
            problems=("the end is missing",),
            losses="1 gap of 1000 points in the blocks",
            ended="closed",
            versions=(("impact_rig", "9.8.7"), ("numpy", "2.4")),
            parameters=(("/hammer", "swing_time: 0.25\nrig_file: ''\n"),),
            notes=(Note(0, "dusty"), Note(START, HOSTILE_NOTE)),
        ),
        warnings=("the recording was never closed",),
    )


@pytest.fixture(scope="session")
def told() -> Run:
    """Return a run with everything there is to tell."""
    return strike_run()


@pytest.fixture(scope="session")
def page(told: Run) -> str:
    """Return the report of one run."""
    return render_page(make_report([told]))


@pytest.fixture(scope="session")
def read(page: str) -> Reader:
    """Return it as a parser reads it."""
    return Reader(page)


@pytest.fixture(scope="session")
def later(told: Run) -> Run:
    """Return another run, in which the damping is a tenth larger and nothing else has changed."""
    results = told.campaign.results
    samples = tuple(
        replace(item, damping_coefficient_n_s_per_m=1.1 * item.damping_coefficient_n_s_per_m)
        for item in results.samples
    )
    campaign = TracedCampaign(replace(results, samples=samples), (), ())
    return replace(told, name="after", campaign=campaign)


@pytest.fixture(scope="session")
def comparison_page(told: Run, later: Run) -> str:
    """Return the report of two runs, without the traces: drawing takes its time."""
    first = replace(told, campaign=TracedCampaign(told.campaign.results, (), ()))
    return render_page(make_report([first, later], unread=["there is no file <gone>"]))


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the figures out, where words are what is asked for."""

    def miss(*values: object, prefix: str = "") -> tuple[ReportFigure, ...]:
        names = (f"{prefix}{number}" for number in range(4))
        return tuple(make_missing_figure(name, "A figure", "Not here.") for name in names)

    monkeypatch.setattr(run_content, "draw_campaign_figures", miss)
    monkeypatch.setattr(run_content, "draw_sample_figure", lambda *a, **b: miss()[0])
    monkeypatch.setattr(comparison_content, "draw_comparison_figure", miss)


@pytest.fixture(scope="session")
def chromium() -> Path:
    """Return the browser, or skip."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip("no Chromium: the page cannot be looked at")
    return Path(found)


@pytest.fixture(scope="session")
def browser(chromium: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Return a browser that is started once."""
    opened = Browser(chromium, tmp_path_factory.mktemp("profile"))
    yield opened
    opened.close()
