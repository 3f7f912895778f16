"""What a recording has of each record and of a running stream is counted, and what it lacks."""

from impact_rig.core.records import HitLabel
from impact_rig.recordings.contents import inspect_recording
from impact_rig.recordings.hits import REMEMBERED, BlockCount, RecordWatch

from .conftest import block_fields

FIRST = HitLabel("brass", record=1)
SECOND = HitLabel("brass", record=2, impact=2)


def add(watch, label, *starts, last=True, points=100):
    """Add a block for each first sample; the last of them ends the record, unless told so."""
    for start in starts:
        watch.add(label, start, points, 1000 + start, last=last and start == starts[-1])


def test_a_record_ends_with_its_last_block():
    watch = RecordWatch()
    add(watch, FIRST, 0, 100, 200, last=False)
    assert not watch.has_finished
    assert watch.unfinished.blocks == 3
    add(watch, FIRST, 300)
    (count,) = watch.collect()
    assert (count.label, count.blocks, count.gaps, count.missing_points) == (FIRST, 4, 0, 0)
    assert count.stamp == 1300
    assert watch.unfinished is None
    assert watch.collect() == ()


def test_missing_points_are_counted_by_record_and_in_all():
    watch = RecordWatch()
    add(watch, FIRST, 100, 400, 500)
    add(watch, SECOND, 0, 150)
    first, second = watch.collect()
    assert (first.gaps, first.missing_points) == (2, 100 + 200)
    assert (second.gaps, second.missing_points) == (1, 50)
    assert (watch.gaps, watch.missing_points) == (3, 350)


def test_the_next_record_ends_one_whose_last_block_never_came():
    watch = RecordWatch()
    add(watch, FIRST, 0, 100, last=False)
    add(watch, SECOND, 0, last=False)
    (count,) = watch.collect()
    assert (count.label, count.blocks) == (FIRST, 2)
    assert watch.unfinished.label == SECOND


def test_an_arming_that_ends_without_its_last_block_ends_the_record():
    watch = RecordWatch()
    add(watch, FIRST, 0, last=False)
    watch.end(1, "brass")
    assert [count.blocks for count in watch.collect()] == [1]


def test_an_arming_without_any_block_is_a_record_of_none():
    watch = RecordWatch()
    add(watch, FIRST, 0)
    watch.end(2, "brass")
    assert [(count.label.record, count.blocks) for count in watch.collect()] == [(1, 1), (2, 0)]


def test_the_end_of_an_arming_may_be_told_after_the_next_record():
    watch = RecordWatch()
    add(watch, FIRST, 0)
    watch.begin(2)
    add(watch, SECOND, 0)
    watch.end(1, "brass")
    watch.end(2, "brass")
    assert [count.blocks for count in watch.collect()] == [1, 1]


def test_the_end_of_an_arming_that_is_told_late_leaves_the_record_under_way_alone():
    watch = RecordWatch()
    add(watch, FIRST, 0)
    # The word that it began was later still than its blocks.
    watch.begin(FIRST.record)
    add(watch, SECOND, 0, 100, last=False)
    watch.end(FIRST.record, FIRST.sample)
    add(watch, SECOND, 200)
    assert [count.label.record for count in watch.collect()] == [1, 1, 2]
    assert (watch.gaps, watch.missing_points, watch.unfinished) == (0, 0, None)


def test_a_number_that_is_used_again_after_a_new_arming_is_another_record():
    watch = RecordWatch()
    add(watch, FIRST, 0)
    watch.begin(1)
    watch.end(1, "brass")
    assert [count.blocks for count in watch.collect()] == [1, 0]


def test_what_was_told_of_long_ago_is_forgotten():
    watch = RecordWatch()
    for record in range(1, 3 * REMEMBERED + 1):
        add(watch, HitLabel("brass", record=record), 0, 100)
        assert [item.label.record for item in watch.collect()] == [record]
    assert watch.has_ended(3 * REMEMBERED)
    assert not watch.has_ended(2 * REMEMBERED)


def watch_blocks(*starts, points=100):
    watch = BlockCount()
    for start in starts:
        watch.add(start, points)
    return watch


def test_every_jump_is_a_gap():
    watch = watch_blocks(0, 250, 350, 1000)
    assert (watch.gaps, watch.missing_points) == (2, 150 + 550)


def test_a_recording_may_begin_in_the_middle_of_a_stream():
    assert watch_blocks(7000, 7100).gaps == 0


def test_accelerometers_that_are_started_again_leave_no_gap():
    watch = watch_blocks(500, 600, 0, 100, 300)
    assert (watch.gaps, watch.missing_points) == (1, 100)


STREAM = "acceleration/stream"
TYPE = "impact_rig_msgs/msg/StreamBlock"
POINTS = 50


def add_blocks(maker, *starts):
    for start in starts:
        maker.add(STREAM, TYPE, block_fields(0, POINTS, first_sample=start, last=False))


def test_gaps_of_a_stream_are_no_damage_of_the_file(make_recording):
    maker = make_recording()
    add_blocks(maker, 0, 100, 150, 500)
    contents = inspect_recording(maker.close())
    (stream,) = contents.streams.values()
    assert (stream.gaps, stream.missing_points) == (2, 50 + 300)
    assert contents.is_sound
    assert contents.hits == ()
