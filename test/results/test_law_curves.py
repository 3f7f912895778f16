"""Pulse and loop of a contact law beside what was measured."""

from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.contact_law import NO_LAW
from impact_rig.core.records import HitLabel
from impact_rig.core.session import Session
from impact_rig.core.setup import PAPER_SETUP
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.contact import make_nominal_contact
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.results.law_curves import compute_law_curves
from impact_rig.results.sample_traces import sample_traces_from_estimate

SAMPLE = "steel medium"
RESTITUTION = 0.7


@pytest.fixture(scope="module")
def struck():
    """Return a sample's estimate and traces after five hits under a contact law."""
    settings = VirtualRigSettings(
        plant=Plant.CONTACT, amplitude_scatter=0.0, restitution=RESTITUTION
    )
    rig, session = VirtualRig(PAPER_SETUP, settings), Session(PAPER_SETUP)
    for impact in range(1, 6):
        for block in rig.strike(HitLabel(SAMPLE, impact, impact)).split(5000, 0):
            session.feed(block)
    estimate, mean = session.estimate_sample(SAMPLE), session.compute_mean(SAMPLE)
    return estimate, sample_traces_from_estimate(estimate, mean)


def test_the_law_lies_on_the_pulse_and_the_versed_sine_beside_it(struck):
    estimate, traces = struck
    curves = compute_law_curves(estimate.contact_law, traces, PAPER_SETUP)
    peak = curves.measured.max()
    law, versed = (
        np.abs(curves.measured - model).max() / peak for model in (curves.law, curves.versed_sine)
    )
    assert law < 3e-3
    assert versed > 1e-2
    assert curves.time[0] == pytest.approx(-curves.time[-1], abs=1e-6)


def test_both_loops_hold_the_energy_lost(struck):
    estimate, traces = struck
    contact = make_nominal_contact(PAPER_SETUP, SAMPLE, 1.5, RESTITUTION)
    lost = contact.equivalent_mass * contact.impact_speed**2 * (1.0 - contact.restitution**2) / 2.0
    curves = compute_law_curves(estimate.contact_law, traces, PAPER_SETUP)
    assert np.trapezoid(curves.law_force, curves.law_indentation) == pytest.approx(lost, rel=0.03)
    assert np.trapezoid(curves.loop_force, curves.indentation) == pytest.approx(lost, rel=0.05)
    assert curves.indentation.max() == pytest.approx(curves.law_indentation.max(), rel=5e-3)


def test_one_trace_has_no_loop_and_no_law_no_curves(struck):
    estimate, traces = struck
    alone = replace(traces, mean=traces.mean[:1])
    assert compute_law_curves(estimate.contact_law, alone, PAPER_SETUP).indentation.size == 0
    assert compute_law_curves(NO_LAW, traces, PAPER_SETUP) is None
