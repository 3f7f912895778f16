"""The exponent of the contact time over the mass."""

import numpy as np
import pytest
from scipy.stats import linregress

from impact_rig.core.errors import NotDeterminedError
from impact_rig.core.estimation.size_exponent import compute_size_residual, estimate_size_exponent

MASSES = [0.02, 0.04, 0.05, 0.07]


def test_one_material_is_a_straight_line_of_logarithms():
    times = np.array([1.0e-4, 1.35e-4, 1.42e-4, 1.66e-4])
    found = estimate_size_exponent(["steel"] * 4, MASSES, times).exponent
    line = linregress(np.log(MASSES), np.log(times))
    assert found.value == pytest.approx(line.slope)
    assert found.standard == pytest.approx(line.stderr)
    assert found.expanded == pytest.approx(4.30265 * line.stderr, rel=1e-5)


def test_every_material_has_its_own_constant():
    materials = ["steel", "brass"] * 4
    masses = [mass for mass in MASSES for _ in range(2)]
    times = [
        mass**0.4 * (1.0 if name == "steel" else 1.7)
        for mass, name in zip(masses, materials, strict=True)
    ]
    assert estimate_size_exponent(materials, masses, times).exponent.value == pytest.approx(0.4)
    assert compute_size_residual(materials, masses, times, 0.4) == pytest.approx(0.0, abs=1e-12)


def test_the_interval_covers_the_truth_as_often_as_it_says():
    generator = np.random.default_rng(1)
    materials = ["a"] * 4 + ["b"] * 4
    masses = np.array(MASSES * 2)
    covered = 0
    for _ in range(1000):
        times = masses**0.4 * np.exp(0.01 * generator.standard_normal(8))
        found = estimate_size_exponent(materials, masses, times).exponent
        covered += abs(found.value - 0.4) <= found.expanded
    assert 930 <= covered <= 970


@pytest.mark.parametrize("materials", [["a", "b", "c"], ["a", "a", "b"]])
def test_too_few_samples_of_one_material_do_not_tell(materials):
    with pytest.raises(NotDeterminedError, match="three different masses"):
        estimate_size_exponent(materials, MASSES[:3], MASSES[:3])
