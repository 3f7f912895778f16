"""Warnings are said once, with whom they are about."""

from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.results.remarks import Remark, gather_warnings


def make_sample(name: str, *warnings: str) -> SampleEstimate:
    return SampleEstimate(name, 1, 0, warnings=warnings)


def test_the_same_warning_is_said_once_of_all_samples():
    samples = [make_sample("tin", "loud", "odd: x"), make_sample("zinc", "loud")]
    assert gather_warnings(samples) == [Remark("loud", "all samples"), Remark("odd: x", "tin")]


def test_what_differs_in_its_details_alone_is_said_once_with_all_of_them():
    samples = [make_sample("tin", "no spring: 1 µs"), make_sample("zinc", "no spring: 2 µs")]
    assert gather_warnings(samples) == [Remark("no spring: tin: 1 µs; zinc: 2 µs")]
