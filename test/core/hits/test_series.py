"""All hits of one sample: what is kept of them, and what becomes of those that are settled."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.hits.averaging import average_hits
from impact_rig.core.hits.hit import FilteredHit, JudgedHit
from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.hits.reasons import Reason, Rejection
from impact_rig.core.hits.series import HitSeries
from impact_rig.core.signals.record import HitLabel

RATE = 2.5e6
TAU = 200e-6
BY_HAND = (Rejection(Reason.OPERATOR, "so"),)


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


def make_series(hits: list[JudgedHit], most: int = 10**6, keep: int = 0) -> HitSeries:
    """Return hits of which no more than `most` are kept with their traces."""
    series = HitSeries("steel", keep)
    for hit in hits:
        series.add(hit)
        while series.traces > most:
            series.settle_one()
    return series


def list_reasons(series: HitSeries) -> dict[int, Reason]:
    return {hit.label.record: hit.rejections[-1].reason for hit in series.select().left_out}


def test_a_hit_comes_back_as_it_was_without_its_traces() -> None:
    rejected = replace(make_hit(2), rejections=(Rejection(Reason.WEAK, "too weak"),))
    overruled = replace(make_hit(3), overruled=BY_HAND)
    selection = make_series([make_hit(1), rejected, overruled]).select()
    # By their text: what is not determined is NaN, which equals nothing.
    assert repr(selection.kept) == repr(
        tuple(replace(hit, filtered=None) for hit in (make_hit(1), overruled))
    )
    assert repr(selection.left_out) == repr((replace(rejected, filtered=None),))


def test_every_hit_of_a_long_series_comes_back_as_it_was() -> None:
    hits = [replace(make_hit(0), label=HitLabel("steel", n), stamp=n) for n in range(400)]
    selection = make_series(hits, most=5).select()
    assert repr(selection.kept) == repr(tuple(replace(hit, filtered=None) for hit in hits))


@given(count=st.integers(1, 12))
def test_up_to_the_limit_the_mean_is_that_of_all_hits_bit_by_bit(count: int) -> None:
    hits = [make_hit(number) for number in range(count)]
    mean = make_series(hits, most=12).find_mean()
    expected = average_hits([hit.filtered for hit in hits if hit.filtered])
    assert mean is not None
    np.testing.assert_array_equal(mean.traces, expected.traces)
    np.testing.assert_array_equal(mean.noise, expected.noise)
    assert (mean.count, len(mean.hits), mean.origin) == (count, count, expected.origin)


def test_settled_hits_are_in_the_mean_and_in_all_that_is_known_of_it() -> None:
    hits = [make_hit(number, noise=1.0 + number % 7) for number in range(40)]
    mean = make_series(hits, most=5).find_mean()
    expected = average_hits([hit.filtered for hit in hits if hit.filtered])
    assert mean is not None
    assert (mean.count, len(mean.hits)) == (40, 5)
    # Sums of floats in another order.
    np.testing.assert_allclose(mean.traces, expected.traces, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(mean.noise, expected.noise, rtol=1e-12)
    for name in ("count", "least_noise", "largest_step", "square_steps", "baseline_points"):
        np.testing.assert_allclose(
            getattr(mean.summary, name), getattr(expected.summary, name), rtol=1e-12
        )
    assert mean.baseline_points == expected.baseline_points


@given(most=st.integers(3, 20), count=st.integers(30, 200))
def test_hits_that_are_kept_lie_evenly_over_the_series(most: int, count: int) -> None:
    hits = [JudgedHit(HitLabel("steel", n, n), (), contact_time=TAU) for n in range(count)]
    filtered = make_hit(0).filtered
    series = make_series([replace(hit, filtered=filtered) for hit in hits], most)
    rows = np.array(list(series._traces))
    assert rows.size == most
    assert (rows[0], rows[-1]) == (0, count - 1)
    # Twice as far apart as if they lay exactly evenly, at most three times.
    assert np.diff(rows).max() <= 3.0 * count / (most - 1) + 1.0


def test_figures_of_settled_hits_are_still_held_against_others() -> None:
    series = make_series([make_hit(number) for number in range(50)], most=4)
    assert series.check(make_hit(50)) == ()
    (found,) = series.check(make_hit(51, factor=1.1))
    assert found.reason is Reason.INCONSISTENT
    assert "of 51 hits" in found.explanation


def test_a_settled_hit_stays_where_it_is() -> None:
    # Of four hits none is an outlier; the fifth and on are of another kind, and more.
    odd = [make_hit(number, factor=1.3) for number in range(3)]
    others = [make_hit(number) for number in range(3, 20)]
    everything = make_series(odd + others)
    assert list_reasons(everything) == dict.fromkeys(range(3), Reason.INCONSISTENT)
    early = make_series(odd + others[:1])
    early.settle_one()
    for hit in others[1:]:
        early.add(hit)
    # One of them was settled before its fellows showed that it was odd.
    assert len(list_reasons(early)) == 2


def test_outliers_are_settled_first_and_keep_their_reason() -> None:
    hits = [make_hit(number) for number in range(12)]
    hits[4] = make_hit(4, factor=1.5)
    series = make_series(hits)
    before = repr(series.select())
    series.settle_one()
    assert series.traces == 11
    assert repr(series.select()) == before
    for number in range(12, 30):
        series.add(make_hit(number))
    assert list_reasons(series) == {4: Reason.INCONSISTENT}


@pytest.mark.parametrize("place", range(1, 9))
def test_what_more_hits_may_show_to_be_an_outlier_waits_until_the_others_are_settled(
    place: int,
) -> None:
    # Of ten hits the scatter is hardly known: 15.7 robust standard deviations are needed. Eight,
    # here 2.4 %, are too many for a good hit all the same, as more hits show.
    deviations = np.tile([-1.2, 0.7, -0.5, 1.3, 0.1, -0.8, 0.4, 0.0, 1.0, -0.2], 6)
    deviations[place] = 8.0
    everything = [
        replace(make_hit(number), contact_time=(1.0 + 0.003 * deviation) * TAU)
        for number, deviation in enumerate(deviations.tolist())
    ]
    hits, more = everything[:10], everything[10:]
    series = make_series(hits)
    while series.traces > 3:
        series.settle_one()
    assert list_reasons(series) == {}
    for hit in more:
        series.add(hit)
        series.settle_one()
    assert list_reasons(series) == {place: Reason.INCONSISTENT}
    good = [hit for hit in hits if hit is not hits[place]]
    mean, expected = series.find_mean(), make_series([*good, *more]).find_mean()
    assert mean is not None
    assert expected is not None
    assert mean.count == expected.count == 59
    np.testing.assert_allclose(mean.traces, expected.traces, rtol=1e-9, atol=1e-9)


def test_where_all_are_doubtful_one_of_them_is_settled() -> None:
    # Where most are alike, 1 % is more than 4.2 of what their number makes the least scatter.
    factors = [1.0] * 5 + [1.01] * 3 + [1.0] * 4
    hits = [replace(make_hit(n), contact_time=f * TAU) for n, f in enumerate(factors)]
    series = make_series(hits)
    kept = []
    while series.traces > 2:
        kept.append(set(series._traces) & {5, 6, 7})
        series.settle_one()
    assert [len(rows) for rows in kept] == [3] * 8 + [2, 1]
    assert len(series.select().kept) == 12


def test_settled_hits_that_are_outliers_by_now_are_told_with_what_they_do() -> None:
    odd, others = make_hit(1, factor=1.3), [make_hit(number) for number in range(2, 30)]
    series = make_series([others[0], odd, others[1]])
    # Of three hits none is doubtful.
    series.settle_one()
    for hit in others[2:]:
        series.add(hit)
    settled = series.look_at_settled()
    assert (settled.count, settled.outliers) == (1, 1)
    times = [hit.contact_time for hit in (odd, *others)]
    assert settled.shift == pytest.approx(1.0 - np.mean(times[1:]) / np.mean(times), rel=1e-9)


def test_settled_hits_that_are_like_the_others_shift_nothing() -> None:
    settled = make_series([make_hit(number) for number in range(40)], most=5).look_at_settled()
    assert (settled.count, settled.outliers, settled.shift) == (35, 0, 0.0)


def test_of_the_most_consistent_hits_none_is_settled_while_others_are_surplus() -> None:
    hits = [make_hit(number) for number in range(40)]
    all_kept, few_kept = make_series(hits, keep=5), make_series(hits, most=20, keep=5)
    assert few_kept.traces == 20
    numbers = [
        [hit.label.record for hit in series.select().kept] for series in (all_kept, few_kept)
    ]
    assert numbers[0] == numbers[1]
    assert set(list_reasons(few_kept).values()) == {Reason.SURPLUS}
    (why,) = {hit.rejections[0].explanation for hit in few_kept.select().left_out}
    assert why == "not among the 5 most consistent of 40"


@given(keep=st.integers(1, 30), most=st.integers(3, 20))
def test_never_more_than_asked_for_are_in_the_mean_however_many_are_settled(
    keep: int, most: int
) -> None:
    series = make_series([make_hit(number) for number in range(30)], most, keep)
    selection, mean = series.select(), series.find_mean()
    assert mean is not None
    assert len(selection.kept) == mean.count == keep
    assert len(selection.kept) + len(selection.left_out) == 30


def test_a_hit_accepted_by_hand_stays_in_the_mean_when_it_is_settled() -> None:
    hits = [make_hit(number) for number in range(30)]
    hits[7] = replace(make_hit(7, factor=2.0), overruled=BY_HAND)
    series = make_series(hits, most=3)
    assert 7 in {hit.label.record for hit in series.select().kept}
    (overruled,) = series.overruled
    assert [item.reason for item in overruled.overruled] == [Reason.INCONSISTENT, Reason.OPERATOR]


def test_memory_does_not_grow_with_the_hits(monkeypatch: pytest.MonkeyPatch) -> None:
    series = make_series([make_hit(number) for number in range(20)], most=8)
    added: list[int] = []
    original = HitSeries._sum_up
    monkeypatch.setattr(
        HitSeries, "_sum_up", lambda self: (added.append(len(self._traces)), original(self))
    )
    for number in range(20, 320):
        series.add(make_hit(number))
        series.settle_one()
    assert series.traces == 8
    assert len(series) == 320
    # No hit of a good series makes the mean be summed up anew.
    assert added == []


def test_what_a_hit_is_held_against_takes_no_memory_as_long_as_the_series() -> None:
    count = 2500
    times = TAU * (1.0 + 0.003 * np.random.default_rng(1).standard_normal(count))
    hit, series = make_hit(0), HitSeries("steel")
    peaks = []
    for number, time in enumerate(times.tolist()):
        struck = replace(hit, label=HitLabel("steel", number, number), contact_time=time)
        if number >= count - 8:
            tracemalloc.start()
            series.check(struck)
            assert series.contact_time_spread > 0.0
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
        series.add(struck)
        if series.traces > 5:
            series.settle_one()
    # One number of each hit would be 20 kB. Now and then what is kept of all of them must grow.
    assert min(peaks) < 10_000
