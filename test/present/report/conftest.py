"""A small campaign with everything there is to tell, and names that no page should trust."""

from dataclasses import replace

import pytest

from impact_rig.configuration.particulars import Particulars
from impact_rig.core.given.sensors import Sensor
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.devices.virtual.choices import Fault, Plant
from impact_rig.devices.virtual.rig import FaultPlan, ScheduledFault, VirtualRigSettings
from impact_rig.present.report.page import render_page
from impact_rig.present.report.report import make_report
from impact_rig.results.traces import ChannelScale, Provenance, RecordedFile, ReportedCampaign

from ..conftest import START, Trace
from .reader import Reader

HOSTILE = "<script>alert('sample')</script>--><b>"
"""A sample's name that would run, or end what it stands in, if it were not escaped."""
HOSTILE_NOTE = '</dd><img src="https://evil.example/x.png" onerror="alert(1)">'


def strike_run(trace: Trace) -> ReportedCampaign:
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
    labels = [(sample.name, impact) for sample in renamed for impact in (1, 2)]
    campaign = trace([*labels, (HOSTILE, 3)], setup, settings)
    calibrations = (
        ChannelScale("hammer", 2.5e6, True, 0.9765625, 0.0, 2000.0),
        ChannelScale("sample", 2.5e6, False, 1.953125, 0.25, 0.0),
    )
    hits = tuple(
        replace(hit, recorded=replace(hit.recorded, calibrations=calibrations))
        for hit in campaign.hits
    )
    return ReportedCampaign(
        name="before",
        campaign=replace(campaign, hits=hits),
        provenance=Provenance(
            start_time=START,
            end_time=START + 12_300_000_000,
            files=(RecordedFile("session.mcap", 1_234_567, "ab" * 32),),
            problems=("the end is missing",),
            losses="1 gap of 1000 points in the blocks",
            ended="closed",
            versions=(("impact_rig", "9.8.7"), ("numpy", "2.4")),
            notes=((0, "dusty"), (START, HOSTILE_NOTE)),
        ),
        warnings=("the recording was never closed",),
    )


@pytest.fixture(scope="session")
def told(trace: Trace) -> ReportedCampaign:
    """Return a run with everything there is to tell."""
    return strike_run(trace)


STATED = Particulars(
    texts={
        "laboratory": {"name": "Lab <7>", "address": "1 Example Road"},
        "report": {
            "number": '4711"; }',
            "replaces": "4710",
            "changes": "hit 3 left out",
            "authorised_by": "B. <Cole>",
        },
        "source.hammer": {"maker": "PCB", "certificate": "D-K-0815"},
        "balance": {"model": "XS 204"},
        "sample.brass medium": {"serial_number": "batch 9"},
    },
    limits={"brass medium": {"contact_time": (1e-4, 2e-4)}},
)


@pytest.fixture(scope="session")
def page(told: ReportedCampaign) -> str:
    """Return the report of one run."""
    return render_page(make_report([told], STATED))


@pytest.fixture(scope="session")
def read(page: str) -> Reader:
    """Return it as a parser reads it."""
    return Reader(page)
