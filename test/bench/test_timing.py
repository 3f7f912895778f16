"""Two ways to do the same thing, timed by turns."""

import itertools

from impact_rig.bench.timing import compare_times, divide


def test_each_side_is_first_in_every_second_turn_after_a_call_that_does_not_count() -> None:
    called: list[str] = []
    ticks = itertools.count()
    ours, peers = compare_times(
        lambda: called.append("work"),
        lambda: called.append("peer"),
        repeats=3,
        calls=(1, 2),
        clock=lambda: float(next(ticks)),
    )
    first, second = ["work", "peer", "peer"], ["peer", "peer", "work"]
    assert called == ["work", "peer", *first, *second, *first]
    # A turn lasts one tick here, however many calls share it.
    assert (ours, peers) == ([1.0] * 3, [0.5] * 3)


def test_a_ratio_is_of_times_of_the_same_turn() -> None:
    assert divide([2.0, 6.0], [1.0, 2.0]) == (2.0, 3.0)
