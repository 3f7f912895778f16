"""The bound of a campaign: noise, hits, masses and clock in the right proportions."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.identification.cramer_rao import compute_model_bound
from impact_rig.core.model.pulses import HERTZ
from impact_rig.core.setup.paper import HAMMER_DAMPING_COEFFICIENT, PAPER_SETUP
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.plants import find_nominal_model
from impact_rig.devices.virtual.rig import VirtualRigSettings
from impact_rig.study.bounds import find_bounds
from impact_rig.study.campaigns import make_exact
from impact_rig.study.cases import Case, Part

SAMPLE = "steel medium"
EXACT = make_exact(PAPER_SETUP)
CALM = VirtualRigSettings(plant=Plant.DYNAMICS, contact_time_scatter=0.0)


def find(rig=CALM, setup=EXACT, hits=1):
    case = Case(Part.BIAS, "axis", "value", 0.0, rig, hits=hits)
    return find_bounds(case, rig, setup, SAMPLE)


def test_one_exact_hit_has_the_bound_of_its_noise():
    model = find_nominal_model(EXACT, SAMPLE, HAMMER_DAMPING_COEFFICIENT)
    digitizer = CALM.digitizer
    # Sensor noise and, independent of it, a quantiser's uniform error of one step.
    noise = [
        math.hypot(digitizer.noise * scale, scale / 2048 / math.sqrt(12))
        for scale in (digitizer.hammer_full_scale, digitizer.specimen_full_scale)
    ]
    bound = compute_model_bound(model, 2.5e6, 5000, 0.2e-3, tuple(noise))
    found = find()
    for quantity, name, truth in (
        ("contact_time", "tau_p", model.contact_time),
        ("stiffness", "k2", model.specimen.stiffness),
        ("damping_coefficient", "c2", model.specimen.damping_coefficient),
    ):
        expected = bound.find_standard_deviation(name) / truth
        assert found[quantity] == pytest.approx(expected, rel=1e-9)
    # zeta goes with c / sqrt(k): drawn, since formulas can be wrong twice.
    draws = np.random.default_rng(1).multivariate_normal(
        np.zeros(len(bound.names)), bound.covariance, 40_000, method="cholesky"
    )
    k2, c2 = (draws[:, bound.names.index(name)] for name in ("k2", "c2"))
    ratio = (1 + c2 / model.specimen.damping_coefficient) / np.sqrt(
        1 + k2 / model.specimen.stiffness
    )
    assert found["damping_ratio"] == pytest.approx(ratio.std(), rel=0.02)


def test_more_hits_tell_more():
    for quantity, bound in find().items():
        assert find(hits=4)[quantity] == pytest.approx(bound / 2)


def test_hits_that_scatter_tell_no_more_than_their_mean():
    scattered = find(replace(CALM, contact_time_scatter=3e-3), hits=9)
    assert scattered["contact_time"] == pytest.approx(1e-3, rel=0.01)
    assert scattered["stiffness"] == find(hits=9)["stiffness"]


def test_stated_masses_and_clock_limit_what_can_be_known():
    found, exact = find(setup=PAPER_SETUP, hits=10_000), find(hits=10_000)
    mass = math.hypot(0.5e-3, 0.005e-3) / math.sqrt(3) / 0.16991  # rounding of printed digits
    clock = PAPER_SETUP.clock_uncertainty
    assert found["contact_time"] == pytest.approx(clock, rel=0.05)
    assert found["stiffness"] == pytest.approx(math.hypot(mass, 2 * clock), rel=0.01)
    assert found["damping_coefficient"] == pytest.approx(math.hypot(mass, clock), rel=0.01)
    assert found["damping_ratio"] == exact["damping_ratio"]


@pytest.mark.parametrize(
    "rig",
    [replace(CALM, plant=Plant.PUBLISHED), replace(CALM, pulse_shape=HERTZ)],
    ids=["another plant", "another pulse"],
)
def test_no_bound_where_the_model_is_not_the_truth(rig):
    assert find(rig) == {}
