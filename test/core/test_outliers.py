"""Outliers among hits, and the most consistent ones of too many."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.hits import FilteredHit, JudgedHit
from impact_rig.core.pulse_width import measure_pulse
from impact_rig.core.records import HitLabel
from impact_rig.core.series import (
    HitSeries,
    Selection,
    compute_threshold,
)
from impact_rig.core.verdict import Reason, Rejection

PULSE = np.exp(-(((np.arange(31) - 15.0) / 5.0) ** 2))[np.newaxis]
NOTHING = np.zeros(1)
FILTERED = FilteredHit(PULSE, 1e6, measure_pulse(PULSE[0]), NOTHING, NOTHING, NOTHING, 5)
"""Traces do not matter here: they are as short as they can be."""


def make_hit(
    number: int, tau: float = 200e-6, peak: float = 900.0, ratio: float = 1.59
) -> JudgedHit:
    label = HitLabel("steel", number, number)
    figures = {"contact_time": tau, "hammer_peak": peak, "width_ratio": ratio}
    return JudgedHit(label, (), **figures, filtered=FILTERED)


def make_hits(count: int, scatter: float = 0.003, seed: int = 1) -> list[JudgedHit]:
    factors = 1.0 + scatter * np.random.default_rng(seed).standard_normal((count, 3))
    return [
        make_hit(number, 200e-6 * a, 900.0 * b, 1.59 * c)
        for number, (a, b, c) in enumerate(factors, start=1)
    ]


def make_series(hits: list[JudgedHit], keep: int = 0) -> HitSeries:
    series = HitSeries(keep)
    for hit in hits:
        series.add(hit)
    return series


def select_hits(hits: list[JudgedHit], keep: int = 0) -> Selection:
    return make_series(hits, keep).select()


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
        hits = [make_hit(i, (200 + i - 5) * 1e-6) for i in range(10)]
        hits.append(make_hit(10, 300e-6))
        (found,) = make_series(hits[:-1]).check(hits[-1])
        assert str(found) == (
            "inconsistent: tau_p 300 µs is 22.5 robust standard deviations from the median"
            " 200 µs of 11 hits"
        )

    @given(count=st.integers(5, 30), size=st.floats(0.0, 0.02))
    def test_a_very_repeatable_rig_does_not_reject_over_nothing(self, count, size):
        hits = [*[make_hit(i) for i in range(count - 1)], make_hit(count, 200e-6 * (1 + size))]
        assert select_hits(hits).left_out == ()
        # Alike to the last digit, even few tell that one is another: 4.2 times 0.5 %.
        hits[-1] = make_hit(count, 200e-6 * 1.0215)
        assert find_numbers(select_hits(hits).left_out) == [count]

    def test_a_figure_that_is_not_known_is_not_held_against_a_hit(self):
        hits = [replace(hit, width_ratio=np.nan) for hit in make_hits(10)]
        hits[3] = replace(hits[3], width_ratio=1.6)
        assert select_hits(hits).left_out == ()

    @given(seed=st.integers(0, 1000), count=st.integers(1, 14))
    def test_the_order_of_arrival_changes_nothing(self, seed, count):
        hits = [*make_hits(count, 0.01, seed), make_hit(count + 1, 240e-6)]
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
        found = np.count_nonzero(deviations > compute_threshold(count) * spread)
        assert 15 <= found <= 60


class TestKeeping:
    """Of more hits than needed, the most consistent."""

    def test_the_nearest_to_the_medians_are_kept(self):
        # Off by 0 to 6 us, in units of the same spread: the two farthest go.
        offsets = [0, 1, -1, 2, -3, 6, -5]
        hits = [make_hit(i, (200 + offset) * 1e-6) for i, offset in enumerate(offsets)]
        selection = select_hits(hits, keep=5)
        assert find_numbers(selection.kept) == [0, 1, 2, 3, 4]
        assert [str(item) for hit in selection.left_out for item in hit.rejections] == [
            "surplus: not among the 5 most consistent of 7"
        ] * 2

    def test_outliers_go_first_and_keep_their_own_reason(self):
        hits = make_hits(12)
        hits[2] = replace(hits[2], contact_time=300e-6)
        selection = select_hits(hits, keep=10)
        assert len(selection.kept) == 10
        reasons = [[item.reason for item in hit.rejections] for hit in selection.left_out]
        assert sorted(reason.value for (reason,) in reasons) == ["inconsistent", "surplus"]

    @given(count=st.integers(0, 20), keep=st.integers(0, 20))
    def test_never_more_than_asked_for_and_none_is_lost(self, count, keep):
        selection = select_hits(make_hits(count), keep)
        assert len(selection.kept) == (min(count, keep) if keep else count)
        assert len(selection.kept) + len(selection.left_out) == count

    def test_one_that_a_person_accepted_stays_and_is_not_held_against_others(self):
        by_hand = replace(make_hit(99, 900e-6), overruled=(Rejection(Reason.OPERATOR, "so"),))
        selection = select_hits([*make_hits(11), by_hand], keep=10)
        assert 99 in find_numbers(selection.kept)
        assert len(selection.kept) == 10
        assert {item.reason for hit in selection.left_out for item in hit.rejections} == {
            Reason.SURPLUS
        }
        # What the others have against it is not forgotten.
        assert Reason.INCONSISTENT in {item.reason for item in selection.kept[-1].overruled}
