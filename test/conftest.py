"""What all tests share: generated input that is the same each time, and a struck campaign."""

# ruff: noqa: E402
from impact_rig.configuration.threads import use_one_thread

use_one_thread()  # before numpy is imported, which reads it once

from collections.abc import Callable, Iterable

import hypothesis
import pytest

from impact_rig.core.session import Session
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.faults import FaultPlan
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.results.campaign import Results
from impact_rig.results.flat_estimates import results_from_session

hypothesis.settings.register_profile("rig", derandomize=True, deadline=None)
hypothesis.settings.load_profile("rig")

Strike = Callable[..., Results]


def strike_samples(
    names: Iterable[str] = PAPER_SETUP.samples.names,
    *,
    setup: RigSetup = PAPER_SETUP,
    impacts: int = 2,
    fault_probability: float = 0.0,
    seed: int = 1,
) -> Results:
    """Strike every sample a number of times, good hits or bad."""
    settings = VirtualRigSettings(seed=seed, faults=FaultPlan(fault_probability))
    rig, session, faults, record = VirtualRig(setup, settings), Session(setup), {}, 0
    for name in names:
        for impact in range(1, impacts + 1):
            record += 1
            hit = rig.strike(HitLabel(name, record, impact))
            faults[record] = tuple(fault.value for fault in hit.faults)
            for block in hit.split(5000, 0):
                session.feed(block)
    return results_from_session(session.estimate_all(), faults)


@pytest.fixture
def strike() -> Strike:
    """Return the function that strikes samples."""
    return strike_samples


@pytest.fixture(scope="session")
def results() -> Results:
    """Return the paper's campaign with two hits each."""
    return strike_samples()
