"""Hits in the stream of a device without a trigger, found as one who sees all of it finds them."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.given.sensors import Sensor
from impact_rig.devices.protocols import AcquisitionPlan, ChannelScale, SourceChannel
from impact_rig.devices.streaming import StreamedSource

RATE, STAMP = 1000.0, 1_700_000_000_000_000_000
LEVEL, BEFORE, POINTS = 5, 4, 12
SCALES = (ChannelScale(2.0, 200.0, 100), ChannelScale(-1.0, 200.0, 100))


def make_plan(*, continuous: bool = False) -> AcquisitionPlan:
    hammer, specimen = (SourceChannel("1", Sensor(name)) for name in ("hammer", "specimen"))
    return AcquisitionPlan(
        RATE, POINTS / RATE, BEFORE / RATE, 2.0 * LEVEL, hammer, specimen, continuous, 10, 10
    )


class FedSource(StreamedSource):
    """Streams what the test feeds it: numbers for the hammer, the same for the sample."""

    def open_device(self, plan: AcquisitionPlan) -> None:
        self.sampling_rate, self.scales = RATE, SCALES
        self.feed([0] * BEFORE)

    def feed(self, numbers: list[int], lost: int = 0) -> None:
        counts = np.repeat(np.array(numbers, np.int32)[:, np.newaxis], 2, axis=1)
        stamp = STAMP + round((self.count + lost) / RATE * 1e9)
        self.take(counts, stamp, lost)


def make_source(*, continuous: bool = False) -> FedSource:
    source = FedSource()
    source.configure(make_plan(continuous=continuous))
    source.arm()
    return source


def find_record(there: dict[int, int]) -> list[int]:
    """Return the places of the first record among numbers by their places."""
    for before, place in pairwise(sorted(there)):
        if place >= BEFORE and abs(there[place]) >= LEVEL > abs(there[before]):
            wanted = range(place - BEFORE, place - BEFORE + POINTS)
            return [each for each in wanted if each in there] if wanted[-1] <= max(there) else []
    return []


pieces = st.tuples(
    st.integers(0, 3),
    st.lists(st.sampled_from([0, 0, 0, 0, 0, 0, 2, -4, 5, -9, -(2**31)]), min_size=1, max_size=20),
)


@given(st.lists(pieces, max_size=20))
def test_a_record_is_what_came_around_the_first_crossing(fed):
    source, there = make_source(), dict.fromkeys(range(BEFORE), 0)
    blocks = []
    for lost, numbers in fed:
        begin = source.count + lost
        there |= {begin + place: number for place, number in enumerate(numbers)}
        source.feed(numbers, lost)
        while not (blocks and blocks[-1].last) and (block := source.read(0.0)):
            blocks.append(block)
    places = find_record(there)
    output = [number for block in blocks for number in block.hammer.output]
    assert output == [there[place] for place in places]
    if places:
        found = [b.first_sample + i for b in blocks for i in range(b.hammer.output.size)]
        first = found[0] - places[0]
        assert found == [place + first for place in places]
        assert [block.last for block in blocks] == [False] * (len(blocks) - 1) + [True]
        assert blocks[0].stamp == STAMP + round(places[0] / RATE * 1e9)
        assert all(block.specimen.scale == -1.0 for block in blocks)


def test_a_pulse_of_no_numbers_is_recorded_so_that_its_verdict_says_so():
    source = make_source()
    source.take(np.full((POINTS, 2), np.nan), STAMP)
    blocks = [source.read(0.0)]
    while not blocks[-1].last:
        blocks.append(source.read(0.0))
    assert np.isnan(blocks[-1].hammer.acceleration).all()


def test_a_stream_comes_as_it_came_with_its_gaps():
    source = make_source(continuous=True)
    source.feed([1, 2, 3])
    source.feed([4, 100], lost=7)
    first, second = source.read(0.0), source.read(0.0)
    assert source.read(0.0) is None
    assert (first.first_sample, first.hammer.output.tolist()) == (0, [1, 2, 3])
    assert (second.first_sample, second.hammer.output.tolist()) == (10, [4, 100])
    assert [first.hammer.overloaded, second.hammer.overloaded] == [False, True]


def test_no_more_is_kept_than_wanted():
    source = make_source(continuous=True)
    for _ in range(50):
        source.feed([0] * 30)
    assert 1500 - 100 - 30 <= source.read(0.0).first_sample <= 1500 - 100
