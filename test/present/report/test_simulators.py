"""The chapter on simulators, where it is asked for."""

from dataclasses import replace

import pytest

from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.present.report.document import Paragraph, Picture
from impact_rig.present.report.simulators import make_simulators_section
from impact_rig.results.run import Run
from impact_rig.results.tables import Table
from impact_rig.results.traced_campaign import TracedCampaign
from impact_rig.simulators.check import find_obstacle
from impact_rig.simulators.parameters import ENGINES

THERE = [engine for engine in ENGINES.values() if not find_obstacle(engine)]


@pytest.fixture(scope="module")
def run(strike) -> Run:
    results = strike((PAPER_SETUP.samples.control_sample, "brass small"))
    return Run("monday", "monday/results.json", TracedCampaign(results, (), ()))


def test_it_has_every_sample_for_every_engine_and_the_control_sample_in_those_that_are_there(run):
    section = make_simulators_section(run)
    tables = [part for part in section.parts if isinstance(part, Table)]
    samples = [sample.name for sample in run.campaign.results.samples]
    for engine, table in zip(ENGINES.values(), tables, strict=False):
        assert table.caption == f"Contacts for {engine.title}"
        assert list(table.columns[0].cells) == samples
        assert not any("nan" in cell for row in table.rows for cell in row)
    assert len(tables) == len(ENGINES) + bool(THERE)
    if THERE:
        assert tables[-1].caption.startswith(PAPER_SETUP.samples.control_sample)
        (picture,) = (part for part in section.parts if isinstance(part, Picture))
        assert picture.figure.is_drawn
    told = [part.text for part in section.parts if isinstance(part, Paragraph)]
    missing = [engine for engine in ENGINES.values() if engine.package and engine not in THERE]
    assert len(told) == len(missing)
    for engine, text in zip(missing, told, strict=True):
        assert text.endswith(f"pip install {engine.package}.")


def test_without_a_law_it_says_why(run):
    samples = [
        replace(item, contact_law=type(item.contact_law)(notes=("there was no pulse",)))
        for item in run.campaign.results.samples[:1]
    ]
    results = replace(run.campaign.results, samples=tuple(samples))
    section = make_simulators_section(replace(run, campaign=TracedCampaign(results, (), ())))
    (part,) = section.parts
    assert "no identified contact law: there was no pulse." in part.text
