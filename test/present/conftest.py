"""A struck campaign with everything there is to see of it."""

from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from impact_rig.analysis.analyze import analyze
from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import PAPER_SETUP, RigSetup
from impact_rig.core.hit.overrules import NO_OVERRULES
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.devices.virtual.truth import make_truth
from impact_rig.results.traces import TracedCampaign

START = 1_700_000_000_123_456_789
"""2023-11-14 22:13:20.1 UTC."""
SETTINGS = VirtualRigSettings(seed=1)
Trace = Callable[..., TracedCampaign]


class Struck(list):
    """Hits without a file, as a source and as its reading."""

    path, size, warnings, has_scale, hammer_unit = Path("struck"), 0, (), True, None
    overrules, verdicts = NO_OVERRULES, {}

    def events(self, _report):
        return self


def trace_campaign(
    hits: Iterable[tuple[str, int]],
    setup: RigSetup = PAPER_SETUP,
    settings: VirtualRigSettings = SETTINGS,
) -> TracedCampaign:
    """Strike samples, each hit by its sample and impact, and keep everything there is to see."""
    rig = VirtualRig(setup, settings)
    labels = [
        HitLabel(name, record, impact) for record, (name, impact) in enumerate(hits, start=1)
    ]
    struck = {label: rig.strike(label) for label in labels}
    blocks = [block for hit in struck.values() for block in hit.split(5000, START)]
    source = Struck([setup, *blocks])
    source.truths = {label: make_truth(struck[label]) for label in labels}
    (campaign,) = analyze(source, keep_traces=True).campaigns
    return campaign


@pytest.fixture(scope="session")
def trace() -> Trace:
    """Return the function that strikes samples and keeps what there is to see."""
    return trace_campaign


@pytest.fixture(scope="session")
def contacts() -> TracedCampaign:
    """Return two samples whose contacts have a law, three hits each."""
    hits = ((name, impact) for name in ("aluminium large", "steel medium") for impact in (1, 2, 3))
    return trace_campaign(hits, settings=VirtualRigSettings(Plant.CONTACT, seed=1))


@pytest.fixture(scope="session")
def struck() -> TracedCampaign:
    """Return three samples of the paper, three hits each."""
    names = ("aluminium large", "steel medium", "brass small")
    return trace_campaign((name, impact) for name in names for impact in (1, 2, 3))
