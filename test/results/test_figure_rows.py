"""What the figures show of each sample, held against the paper's tables."""

import math
from dataclasses import replace

import pytest

from impact_rig.core.setup import PUBLISHED_SAMPLES
from impact_rig.results.figure_rows import make_figure_rows, sort_as_figure_5


def test_each_sample_has_its_place(results):
    rows = make_figure_rows(results)
    assert [row.estimate.name for row in rows] == [cell.name for cell in PUBLISHED_SAMPLES]
    for row, cell in zip(rows, PUBLISHED_SAMPLES, strict=True):
        assert row.material == cell.material
        # Table 1: the hammer of 100 g, every sample carries 3 g.
        mass = cell.mass + 0.003
        assert row.relative_mass == pytest.approx(0.1 * mass / (0.1 + mass), rel=1e-12)
        assert row.reference.published == cell


def test_every_hit_of_the_mean_is_a_point_around_it(results):
    for row in make_figure_rows(results):
        assert len(row.contact_times) == 2
        assert min(row.contact_times) <= row.estimate.contact_time.value * 1.001
        assert max(row.contact_times) >= row.estimate.contact_time.value * 0.999
        assert row.estimate.specimen_peak > 0.0
        assert row.estimate.mse_hammer_percent < 0.25


def test_without_masses_there_is_no_relative_mass(results):
    setup = replace(results.setup, hammer_mass=math.nan)
    rows = make_figure_rows(replace(results, setup=setup))
    assert all(math.isnan(row.relative_mass) for row in rows)
    assert all(row.estimate.contact_time.is_known for row in rows)


def test_samples_without_a_material_are_each_their_own(results):
    known = results.setup.samples
    samples = replace(
        known, samples=tuple(replace(sample, material="") for sample in known.samples)
    )
    rows = make_figure_rows(replace(results, setup=replace(results.setup, samples=samples)))
    assert [row.material for row in rows] == [row.estimate.name for row in rows]


def test_the_three_cases_of_figure_5_come_first():
    names = ("aluminium small", "aluminium large", "tin", "brass small")
    assert sort_as_figure_5(names) == ("brass small", "aluminium large", "aluminium small", "tin")
    assert sort_as_figure_5(()) == ()
