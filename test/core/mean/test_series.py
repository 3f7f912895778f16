"""All hits of one sample: which are in the mean, early and late, and what is known of them.

Outliers among hits, the most consistent ones of too many, and hits aligned and averaged.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.given.findings import Finding, Reason
from impact_rig.core.given.records import HitLabel
from impact_rig.core.hit.judging import FilteredHit, JudgedHit
from impact_rig.core.hit.pulse_width import measure_pulse
from impact_rig.core.mean.series import HitSeries, Selection, compute_thresholds

from ..blocks import average_hits

RATE = 2.5e6
TAU = 200e-6


def make_bells(
    middle: float, count: int = 1000, height: float = 100.0, noise: float = 0.0
) -> FilteredHit:
    """Return a hit of two bells: the hammer's around `middle`, the sample's 40 points later."""
    points = np.arange(count)
    random = np.random.default_rng(round(1000 * middle))
    traces = np.stack(
        [
            height * np.exp(-(((points - middle) / 50.0) ** 2)),
            -0.4 * height * np.exp(-(((points - middle - 40) / 60.0) ** 2)),
        ]
    )
    traces += noise * random.standard_normal(traces.shape)
    levels = np.array([noise, noise])
    pulse = measure_pulse(traces[0])
    return FilteredHit(traces, RATE, pulse, levels, 2.0 * levels, np.zeros(2), 100)


def make_hit(number: int, factor: float = 1.0, noise: float = 1.0) -> JudgedHit:
    """Return a hit whose contact time is `factor` times the others'."""
    random = np.random.default_rng(number)
    return JudgedHit(
        HitLabel("steel", number, number, 1),
        (),
        stamp=number,
        contact_time=TAU * factor * (1.0 + 0.003 * random.standard_normal()),
        hammer_peak=100.0,
        width_ratio=1.6,
        filtered=make_bells(250.0 + number % 5 + random.random(), 600, noise=noise),
    )


def make_series(hits: list[JudgedHit], count: int | None = None) -> HitSeries:
    """Return a series of the first hits; those to come are known, too."""
    series = HitSeries(lambda place: hits[place].filtered)
    for hit in hits[:count]:
        series.add(hit)
    return series


def list_reasons(series: HitSeries) -> dict[int, Reason]:
    return {hit.label.record: hit.rejections[-1].reason for hit in series.select().left_out}


def check_mean(series: HitSeries, hits: list[JudgedHit]) -> None:
    """Hold the mean of a series against the mean of these hits, bit by bit."""
    mean = series.compute_mean()
    expected = average_hits([hit.filtered for hit in hits if hit.filtered])
    for name, value in vars(expected).items():
        if name != "hits":
            np.testing.assert_array_equal(getattr(mean, name), value)


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


def test_a_late_outlier_is_taken_out_and_comes_back():
    # Of ten hits the scatter is hardly known: 15.7 robust standard deviations are needed. Eight,
    # here 2.4 %, are too many for a good hit all the same, as more hits show, until these
    # scatter as much themselves.
    deviations = np.tile([-1.2, 0.7, -0.5, 1.3, 0.1, -0.8, 0.4, 0.0, 1.0, -0.2], 25)
    deviations[4], deviations[60:] = 8.0, 5.0 * deviations[60:]
    hits = [
        replace(make_hit(number), contact_time=(1.0 + 0.003 * deviation) * TAU)
        for number, deviation in enumerate(deviations.tolist())
    ]
    series = make_series(hits, 10)
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


PULSE = np.exp(-(((np.arange(31) - 15.0) / 5.0) ** 2))[np.newaxis]
NOTHING = np.zeros(1)
FILTERED = FilteredHit(PULSE, 1e6, measure_pulse(PULSE[0]), NOTHING, NOTHING, NOTHING, 5)
"""Traces do not matter here: they are as short as they can be."""


def make_figures(
    number: int, tau: float = 200e-6, peak: float = 900.0, ratio: float = 1.59
) -> JudgedHit:
    label = HitLabel("steel", number, number)
    figures = {"contact_time": tau, "hammer_peak": peak, "width_ratio": ratio}
    return JudgedHit(label, (), **figures, filtered=FILTERED)


def make_hits(count: int, scatter: float = 0.003, seed: int = 1) -> list[JudgedHit]:
    factors = 1.0 + scatter * np.random.default_rng(seed).standard_normal((count, 3))
    return [
        make_figures(number, 200e-6 * a, 900.0 * b, 1.59 * c)
        for number, (a, b, c) in enumerate(factors, start=1)
    ]


def select_hits(hits: list[JudgedHit]) -> Selection:
    return make_series(hits).select()


def find_numbers(hits: tuple[JudgedHit, ...]) -> list[int]:
    return [hit.label.record for hit in hits]


class TestOutliers:
    """Hits that are not like the others."""

    @pytest.mark.parametrize("place", [0, 4, 9])
    @pytest.mark.parametrize(
        ("attribute", "factor"),
        [("contact_time", 1.1), ("hammer_peak", 0.5), ("width_ratio", 1.2)],
    )
    def test_one_among_ten_is_found_wherever_it_stands(self, place, attribute, factor):
        hits = make_hits(10)
        hits[place] = replace(hits[place], **{attribute: factor * getattr(hits[0], attribute)})
        selection = select_hits(hits)
        assert find_numbers(selection.left_out) == [place + 1]
        assert [item.reason for item in selection.left_out[0].rejections] == [Reason.INCONSISTENT]
        assert len(selection.kept) == 9

    def test_it_is_described_in_figures(self):
        # Deviations of 0, 1, 1, 2, 2, ... us: of eleven hits the sixth largest, 3 us, is the MAD.
        hits = [make_figures(i, (200 + i - 5) * 1e-6) for i in range(10)]
        hits.append(make_figures(10, 300e-6))
        (found,) = make_series(hits[:-1]).check(hits[-1]).rejections
        assert str(found) == (
            "inconsistent: tau_p 300 µs is 22.5 robust standard deviations from the median"
            " 200 µs of 11 hits"
        )

    @given(count=st.integers(5, 30), size=st.floats(0.0, 0.02))
    def test_a_very_repeatable_rig_does_not_reject_over_nothing(self, count, size):
        hits = [
            *[make_figures(i) for i in range(count - 1)],
            make_figures(count, 200e-6 * (1 + size)),
        ]
        assert select_hits(hits).left_out == ()
        # Alike to the last digit, even few tell that one is another: 4.2 times 0.5 %.
        hits[-1] = make_figures(count, 200e-6 * 1.0215)
        assert find_numbers(select_hits(hits).left_out) == [count]

    def test_a_figure_that_is_not_known_is_not_held_against_a_hit(self):
        hits = [replace(hit, width_ratio=np.nan) for hit in make_hits(10)]
        hits[3] = replace(hits[3], width_ratio=1.6)
        assert select_hits(hits).left_out == ()

    @given(seed=st.integers(0, 1000), count=st.integers(1, 14))
    def test_the_order_of_arrival_changes_nothing(self, seed, count):
        hits = [*make_hits(count, 0.01, seed), make_figures(count + 1, 240e-6)]
        turned = select_hits(hits[::-1])
        straight = select_hits(hits)
        assert repr(turned.kept[::-1]) == repr(straight.kept)
        assert repr(turned.left_out[::-1]) == repr(straight.left_out)


class TestThresholds:
    """How often good hits are left out."""

    @pytest.mark.parametrize("count", [5, 10, 60])
    def test_normal_hits_are_left_out_no_more_often_than_stated(self, count):
        # 1.2e6 values at a probability of 3.3e-5: 40 are expected, of which 60 are chance in one
        # run of a thousand; fewer than 15 would mean a threshold that is far too high.
        values = np.random.default_rng(count).standard_normal((1_200_000 // count, count))
        deviations = np.abs(values - np.median(values, axis=1, keepdims=True))
        spread = 1.4826 * np.median(deviations, axis=1, keepdims=True)
        found = np.count_nonzero(deviations > compute_thresholds(np.array([count]))[0] * spread)
        assert 15 <= found <= 60


def test_one_that_a_person_accepted_is_not_held_against_others():
    by_hand = replace(make_figures(99, 900e-6), overruled=(Finding(Reason.OPERATOR, "so"),))
    selection = select_hits([*make_hits(11), by_hand])
    assert len(selection.kept) == 12
    # What the others have against it is not forgotten.
    assert Reason.INCONSISTENT in {item.reason for item in selection.kept[-1].overruled}


@given(middles=st.lists(st.floats(300, 500), min_size=1, max_size=12))
def test_the_mean_of_hits_that_differ_in_time_alone_is_the_hit(middles):
    mean = average_hits([make_bells(middle) for middle in middles])
    assert mean.count == len(middles)
    points = np.arange(mean.traces.shape[1]) - mean.origin
    expected = [
        100.0 * np.exp(-((points / 50.0) ** 2)),
        -40.0 * np.exp(-(((points - 40) / 60.0) ** 2)),
    ]
    # Middles are found within 3e-3 points, on slopes of at most 2 per point.
    np.testing.assert_allclose(mean.traces, expected, rtol=0, atol=0.01)


def test_the_mean_is_as_long_as_what_all_hits_have_in_common():
    mean = average_hits([make_bells(300.0, 1000), make_bells(500.2, 900)])
    assert mean.origin == 300
    # Behind the middle: 900 - 1 - 500 points of the shorter one, whose shift costs one.
    assert mean.traces.shape == (2, 300 + 399)


def test_noise_falls_with_the_square_root_of_the_hits():
    hits = [make_bells(400.0 + step, noise=2.0) for step in range(16)]
    mean = average_hits(hits)
    np.testing.assert_allclose(mean.noise, 2.0 / 4)
    np.testing.assert_allclose(mean.raw_noise, 4.0 / 4)
    # What is stated is what is there: far from the pulse nothing else is left. Interpolation
    # between points takes up to a third of white noise away.
    assert 0.6 * 0.5 < mean.traces[0, :150].std() < 1.1 * 0.5
