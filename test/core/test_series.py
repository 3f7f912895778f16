"""All hits of one sample: which are in the mean, early and late, and what is known of them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.hits import FilteredHit, JudgedHit, average_hits
from impact_rig.core.pulse_width import measure_pulse
from impact_rig.core.records import HitLabel
from impact_rig.core.series import HitSeries
from impact_rig.core.verdict import Reason

RATE = 2.5e6
TAU = 200e-6


def make_hit(number: int, factor: float = 1.0, noise: float = 1.0) -> JudgedHit:
    """Return a hit whose contact time is `factor` times the others'."""
    random = np.random.default_rng(number)
    points = np.arange(600) - 250 - number % 5 - random.random()
    traces = np.stack([100.0 * np.exp(-((points / width) ** 2)) for width in (50.0, 60.0)])
    traces += noise * random.standard_normal(traces.shape)
    levels = np.array([noise, noise])
    filtered = FilteredHit(traces, RATE, measure_pulse(traces[0]), levels, levels, levels, 100)
    return JudgedHit(
        HitLabel("steel", number, number, 1),
        (),
        stamp=number,
        contact_time=TAU * factor * (1.0 + 0.003 * random.standard_normal()),
        hammer_peak=100.0,
        width_ratio=1.6,
        filtered=filtered,
    )


def make_series(hits: list[JudgedHit], keep: int = 0) -> HitSeries:
    series = HitSeries(keep)
    for hit in hits:
        series.add(hit)
    return series


def test_the_mean_of_one_hit_is_that_hit():
    hit = make_hit(3)
    mean = make_series([hit]).compute_mean()
    np.testing.assert_array_equal(mean.traces, hit.filtered.traces)
    assert measure_pulse(mean.traces[0]) == hit.filtered.pulse
    (shown,) = mean.hits
    np.testing.assert_allclose(shown.traces, mean.traces, rtol=1e-6)


def list_reasons(series: HitSeries) -> dict[int, Reason]:
    return {hit.label.record: hit.rejections[-1].reason for hit in series.select().left_out}


def check_mean(series: HitSeries, hits: list[JudgedHit]) -> None:
    """Hold the mean of a series against the mean of these hits, bit by bit."""
    mean = series.compute_mean()
    expected = average_hits([hit.filtered for hit in hits if hit.filtered])
    np.testing.assert_array_equal(mean.traces, expected.traces)
    np.testing.assert_array_equal(mean.noise, expected.noise)
    assert (mean.count, mean.origin) == (expected.count, expected.origin)
    assert repr(mean.summary) == repr(expected.summary)
    assert mean.baseline_points == expected.baseline_points


@given(count=st.integers(2, 12))
def test_the_mean_is_that_of_all_hits_bit_by_bit(count):
    hits = [make_hit(number, noise=1.0 + number % 7) for number in range(count)]
    series = make_series(hits)
    check_mean(series, hits)
    shown = series.compute_mean()
    for hit, single in zip(shown.cut_hits(), hits, strict=True):
        alone = average_hits([single.filtered])
        first = alone.origin - shown.origin
        np.testing.assert_array_equal(hit, alone.traces[:, first : first + hit.shape[1]])


def test_an_early_outlier_is_taken_out_as_soon_as_there_are_others():
    # Of four hits none is an outlier; the fifth and on are of another kind, and more.
    odd = [make_hit(number, factor=1.3) for number in range(3)]
    others = [make_hit(number) for number in range(3, 20)]
    series = make_series([*odd, *others])
    assert list_reasons(series) == dict.fromkeys(range(3), Reason.INCONSISTENT)
    check_mean(series, others)


def test_a_late_outlier_is_taken_out_and_comes_back():
    # Of ten hits the scatter is hardly known: 15.7 robust standard deviations are needed. Eight,
    # here 2.4 %, are too many for a good hit all the same, as more hits show, until these
    # scatter as much themselves.
    deviations = np.tile([-1.2, 0.7, -0.5, 1.3, 0.1, -0.8, 0.4, 0.0, 1.0, -0.2], 26)
    deviations[4], deviations[60:] = 8.0, 5.0 * deviations[60:]
    hits = [
        replace(make_hit(number), contact_time=(1.0 + 0.003 * deviation) * TAU)
        for number, deviation in enumerate(deviations.tolist())
    ]
    series = make_series(hits[:10])
    assert list_reasons(series) == {}
    for hit in hits[10:60]:
        series.add(hit)
    assert list_reasons(series) == {4: Reason.INCONSISTENT}
    check_mean(series, [*hits[:4], *hits[5:60]])
    for hit in hits[60:]:
        series.add(hit)
    assert list_reasons(series) == {}
    check_mean(series, hits)


@pytest.mark.parametrize(("count", "shown"), [(128, 128), (129, 65), (256, 128), (300, 75)])
def test_of_a_long_series_hits_that_lie_evenly_show_the_scatter(count, shown):
    hits = [make_hit(number % 7) for number in range(count)]
    series = make_series(hits)
    mean = series.compute_mean()
    assert (mean.count, len(mean.hits)) == (count, shown)
    check_mean(series, hits)
    assert len(series.select().kept) == count


def test_what_is_told_of_the_spread_is_that_of_the_hits_in_the_mean():
    hits = [make_hit(number) for number in range(12)]
    times = [hit.contact_time for hit in hits]
    series = make_series([*hits, make_hit(12, factor=1.5)])
    assert series.contact_time_spread == pytest.approx(np.std(times, ddof=1), rel=1e-12)
    assert np.isnan(make_series(hits[:1]).contact_time_spread)
