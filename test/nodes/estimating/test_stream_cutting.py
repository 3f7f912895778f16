"""What the estimator makes of a running stream, and says of it."""

from types import SimpleNamespace

import numpy as np
import pytest

from impact_rig.core.errors import SignalError
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.record import NOT_ARMED, ChannelBlock, HitLabel
from impact_rig.nodes.estimating.stream_cutting import StreamCutting
from impact_rig.nodes.stream_messages import place_stream_block, stream_block_to_msg

RATE, SIZE = 1e6, 1000
ARMING = HitLabel("oak", record=4)


class Publisher:
    def __init__(self):
        self.published = []
        self.publish = self.published.append


@pytest.fixture
def publisher():
    return Publisher()


@pytest.fixture
def sources():
    """Return the topics of all publishers."""
    return ["acceleration/stream"]


@pytest.fixture
def cutting(publisher, sources):
    node = SimpleNamespace(advertise=lambda topic: publisher, count_publishers=sources.count)
    return StreamCutting(node)


def make_end(number):
    """Return the block that ends a stream."""
    nothing = ChannelBlock(np.zeros(0, np.int32), 1.0, 0.0, 2000.0)
    message = stream_block_to_msg(nothing, nothing, RATE)
    place_stream_block(message, number * SIZE, number * 1_000_000, NOT_ARMED, last=True)
    return message


def make_block(number, *, full_scale=2000.0, impact=False):
    counts = np.zeros(SIZE, np.int32)
    if impact:
        counts[300:500] = 900
    channel = ChannelBlock(counts, 1.0, 0.0, full_scale)
    message = stream_block_to_msg(channel, channel, RATE)
    place_stream_block(message, number * SIZE, number * 1_000_000, ARMING, last=False)
    return message


def test_an_impact_is_published_as_a_block_of_its_arming(cutting, publisher):
    cutting.use_settings(AnalysisSettings())
    for number in range(6):
        cutting.feed(make_block(number, impact=number == 2))
    (block,) = publisher.published
    assert (block.record, block.sample, block.first_sample, block.last) == (4, "oak", 0, True)
    # Two pre-triggers before the impact, a record from the second one on.
    assert np.argmax(np.array(block.hammer.counts)) == 400
    assert len(block.hammer.counts) == 2200
    figures = cutting.describe()
    assert (figures["stream blocks"], figures["stream gaps"]) == (6, 0)
    assert cutting.find_warning() == ""


def test_lost_points_are_counted_and_warned_of(cutting):
    cutting.use_settings(AnalysisSettings())
    for number in (0, 1, 4, 5):
        cutting.feed(make_block(number))
    assert cutting.describe()["stream points missing"] == 2000
    assert cutting.find_warning().startswith("2000 points of the stream were lost")


def test_a_stream_that_stands_still_though_it_has_not_ended_is_warned_of(
    cutting, sources, monkeypatch
):
    now = 1000.0
    monkeypatch.setattr("impact_rig.nodes.estimating.stream_cutting.time.monotonic", lambda: now)
    cutting.use_settings(AnalysisSettings())
    cutting.feed(make_block(0))
    now += 1.0
    assert cutting.find_warning() == ""
    now += 4.0
    assert cutting.find_warning().startswith(
        "the stream stands still: its next block is due since"
    )
    cutting.feed(make_block(1))
    assert cutting.find_warning() == ""
    now += 5.0
    sources.clear()
    # Whoever sent it is gone, and says that for himself.
    assert cutting.find_warning() == ""


def test_a_stream_that_has_ended_is_not_waited_for(cutting, monkeypatch):
    now = 1000.0
    monkeypatch.setattr("impact_rig.nodes.estimating.stream_cutting.time.monotonic", lambda: now)
    cutting.use_settings(AnalysisSettings())
    cutting.feed(make_block(0))
    cutting.feed(make_end(1))
    now += 60.0
    assert cutting.find_warning() == ""


def test_other_settings_go_on_with_the_stream_from_where_it_is(cutting, publisher):
    cutting.use_settings(AnalysisSettings())
    cutting.feed(make_block(0))
    cutting.use_settings(AnalysisSettings(record_duration=1e-3))
    for number in range(7, 12):
        cutting.feed(make_block(number, impact=number == 8))
    assert len(publisher.published[0].hammer.counts) == 1200
    assert cutting.find_warning() == ""


def test_without_a_set_up_nothing_is_searched_and_nothing_said(cutting, publisher):
    cutting.feed(make_block(0, impact=True))
    assert publisher.published == []
    assert cutting.describe()["stream blocks"] == 0


def test_a_stream_that_cannot_be_searched_is_complained_of_once(cutting):
    cutting.use_settings(AnalysisSettings())
    with pytest.raises(SignalError, match="does not say the hammer's full scale"):
        cutting.feed(make_block(0, full_scale=0.0))
    cutting.feed(make_block(1, full_scale=0.0))
