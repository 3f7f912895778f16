"""What a recording has of each record and of a running stream is counted, and what it lacks."""

from dataclasses import asdict
from types import SimpleNamespace

import pytest

from impact_rig.core.given.records import HitLabel
from impact_rig.recordings.contents import inspect_run
from impact_rig.recordings.fields import NO_ID
from impact_rig.recordings.hits import RecordedReason, RecordWatch
from impact_rig.recordings.run import Run

from .conftest import OUR_MESSAGES, OURS, block_fields

FIRST = HitLabel("brass", record=1)
SECOND = HitLabel("brass", record=2, impact=2)


def make_block(label, start, stream_id=NO_ID):
    """Return a block of a record as a message."""
    return SimpleNamespace(
        **asdict(label),
        header=SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=1000 + start)),
        stream_id=SimpleNamespace(uuid=stream_id),
        first_sample=start,
        last=False,
        hammer=SimpleNamespace(counts=range(100), values=()),
    )


@pytest.mark.parametrize(("label", "stream_id"), [(SECOND, NO_ID), (FIRST, b"another stream  ")])
def test_the_next_record_ends_one_whose_last_block_never_came(label, stream_id):
    watch = RecordWatch()
    for start in (0, 100):
        watch.add(make_block(FIRST, start))
    (count,) = watch.add(make_block(label, 0, stream_id))
    assert (count.label, count.blocks) == (FIRST, 2)
    assert watch.unfinished.blocks == 1


STREAM = "acceleration/stream"
TYPE = "impact_rig_msgs/msg/StreamBlock"
POINTS = 50


def add_blocks(maker, *starts):
    for start in starts:
        maker.add(STREAM, TYPE, block_fields(0, POINTS, first_sample=start, last=False))


def test_gaps_of_a_stream_are_no_damage_of_the_file(make_recording):
    maker = make_recording()
    # A stream that begins again leaves no gap.
    add_blocks(maker, 700, 0, 100, 150, 500)
    contents = inspect_run(Run(maker.close()))
    (stream,) = contents.streams.values()
    assert (stream.gaps, stream.missing_points) == (2, 50 + 300)
    assert contents.is_sound
    assert contents.hits == ()


def test_a_reason_of_an_older_recording_is_a_sentence_without_a_code(make_recording, install):
    now = (OUR_MESSAGES / "Impact.msg").read_text()
    then = now.replace("Finding[]", "string[]")
    found = []
    for text, reason in (
        (now, {"reason": "weak", "explanation": "too weak"}),
        (then, "weak: too weak"),
    ):
        install("impact_rig_msgs", "Impact", text)
        maker = make_recording(f"{len(found)}.mcap")
        maker.add_block(1)
        verdict = {"record": 1, "sample": "brass", "impact": 3, "attempt": 2, "reasons": [reason]}
        maker.add("impact", OURS + "Impact", verdict)
        (hit,) = inspect_run(Run(maker.close())).hits
        found += hit.rejections
    assert found == [RecordedReason("weak", "too weak"), RecordedReason("", "weak: too weak")]


def test_a_verdict_on_a_number_that_no_block_has_is_a_stranger_s_and_nothing_is_lost(
    make_recording,
):
    maker = make_recording()
    maker.add_setup()
    maker.add_block(1)
    verdict = {"record": 6, "sample": "brass", "impact": 3, "attempt": 2, "reasons": []}
    maker.add("impact", OURS + "Impact", verdict)
    contents = inspect_run(Run(maker.close()))
    assert [hit.record for hit in contents.hits] == [1]
    assert contents.is_sound
