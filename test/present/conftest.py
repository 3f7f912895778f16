"""A struck campaign with everything there is to see of it."""

from collections.abc import Callable, Iterable

import pytest

from impact_rig.core.records import HitLabel
from impact_rig.core.session import Session
from impact_rig.core.setup import PAPER_SETUP, RigSetup
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.results.campaign import hit_results_from_judged, results_from_session
from impact_rig.results.hit_traces import TraceAssembler
from impact_rig.results.sample_traces import align_hit, sample_traces_from_estimate
from impact_rig.results.traced_campaign import TracedCampaign, TracedHit

START = 1_700_000_000_123_456_789
"""2023-11-14 22:13:20.1 UTC."""
SETTINGS = VirtualRigSettings(seed=1)
Trace = Callable[..., TracedCampaign]


def trace_campaign(
    hits: Iterable[tuple[str, int]],
    setup: RigSetup = PAPER_SETUP,
    settings: VirtualRigSettings = SETTINGS,
    *,
    with_models: bool = False,
) -> TracedCampaign:
    """Strike samples, each hit by its sample and impact, and keep everything there is to see."""
    rig, session, assembler = VirtualRig(setup, settings), Session(setup), TraceAssembler()
    recorded, aligned, faults = {}, {}, {}
    for record, (sample, impact) in enumerate(hits, start=1):
        label = HitLabel(sample, record, impact)
        hit = rig.strike(label)
        faults[record] = tuple(fault.value for fault in hit.faults)
        for block in hit.split(5000, START):
            aligned |= {judged.label: align_hit(judged) for judged in session.feed(block)}
            if (traces := assembler.feed(block)) is not None:
                recorded[label] = traces
    found = session.estimate_all() if with_models else session.estimate_all_without_models()
    judged = {hit.label: hit for hit in (*found.accepted, *found.rejected)}
    means = [
        sample_traces_from_estimate(estimate, session.compute_mean(estimate.name))
        for estimate in found.samples
    ]
    return TracedCampaign(
        results=results_from_session(found, faults),
        samples=tuple(means),
        hits=tuple(
            TracedHit(
                hit_results_from_judged(judged[label], faults[label.record]),
                judged[label].stamp,
                traces,
                aligned[label],
            )
            for label, traces in recorded.items()
        ),
    )


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
    """Return three samples of the paper, three hits each; no model is fitted, which takes long."""
    names = ("aluminium large", "steel medium", "brass small")
    return trace_campaign((name, impact) for name in names for impact in (1, 2, 3))
