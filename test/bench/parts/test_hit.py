"""The part `hit`: the peer does the same filtering, and every hit is really judged."""

import numpy as np

from impact_rig.bench.part import Bench
from impact_rig.bench.parts import hit
from impact_rig.core.signals.filtering import low_pass


def test_the_peer_filters_as_the_analysis_does() -> None:
    (blocks,) = hit.strike_hits(1)
    traces = hit.read_traces(blocks)
    (found,) = hit.filter_all([traces], hit.design_sections())
    expected = low_pass(traces, hit.CUTOFF, hit.SAMPLING_RATE)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_every_hit_is_found_and_accepted() -> None:
    assert hit.count_accepted(hit.strike_hits(13)) == 13


def test_the_time_of_a_hit_and_its_ratio_are_measured(bench: Bench) -> None:
    ratio, time = hit.measure(bench)
    assert str(ratio.goal) == "at most 2"
    assert (str(time.goal), time.unit) == ("at most 1", "ms")
    assert len(ratio.values) == len(time.values) == bench.extent.repeats
    assert 0.1 < ratio.median < 100.0
