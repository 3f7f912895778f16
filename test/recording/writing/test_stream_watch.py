"""What a recording has of a running stream: blocks, gaps, missing points."""

from impact_rig.recording.writing.stream_watch import StreamWatch


def watch_blocks(*starts, points=100):
    watch = StreamWatch()
    for start in starts:
        watch.add(start, points)
    return watch


def test_blocks_that_follow_one_another_lack_nothing():
    watch = watch_blocks(0, 100, 200)
    assert (watch.blocks, watch.points, watch.gaps, watch.missing_points) == (3, 300, 0, 0)


def test_every_jump_is_a_gap():
    watch = watch_blocks(0, 250, 350, 1000)
    assert (watch.gaps, watch.missing_points) == (2, 150 + 550)


def test_a_recording_may_begin_in_the_middle_of_a_stream():
    assert watch_blocks(7000, 7100).gaps == 0


def test_accelerometers_that_are_started_again_leave_no_gap():
    watch = watch_blocks(500, 600, 0, 100, 300)
    assert (watch.gaps, watch.missing_points) == (1, 100)
