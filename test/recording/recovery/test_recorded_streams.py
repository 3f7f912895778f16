"""What a recording has of a running stream, and what it says that it lacks."""

from impact_rig.recording.recovery.inspection import inspect_recording

STREAM = "acceleration/stream"
TYPE = "impact_rig_msgs/msg/StreamBlock"
POINTS = 50


def add_blocks(maker, *starts):
    counts = {"counts": [7] * POINTS, "values": [], "scale": 1.0, "offset": 0.0, "full_scale": 9.0}
    header = {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": ""}
    for start in starts:
        fields = {"first_sample": start, "sampling_rate": 2.5e6, "record": 0, "sample": ""}
        label = {"impact": 0, "attempt": 0, "last": False, "hammer": counts, "specimen": counts}
        maker.add(STREAM, TYPE, {"header": header, **fields, **label})


def test_blocks_and_points_of_a_stream_are_counted(make_recording):
    maker = make_recording(namespace="/hall")
    add_blocks(maker, 1000, 1050, 1100)
    (stream,) = inspect_recording(maker.close()).streams
    assert (stream.topic, stream.blocks) == ("/hall/acceleration/stream", 3)
    assert (stream.points, stream.gaps, stream.missing_points) == (3 * POINTS, 0, 0)


def test_gaps_of_a_stream_are_no_damage_of_the_file(make_recording):
    maker = make_recording()
    add_blocks(maker, 0, 100, 150, 500)
    contents = inspect_recording(maker.close())
    (stream,) = contents.streams
    assert (stream.gaps, stream.missing_points) == (2, 50 + 300)
    assert contents.is_sound
    assert contents.hits == ()


def test_a_stream_goes_on_from_file_to_file(make_recording):
    maker = make_recording("session", split_size=1, chunk_size=1)
    add_blocks(maker, 0, 50, 100, 250)
    contents = inspect_recording(maker.close())
    assert len(contents.files) > 2
    assert [(stream.blocks, stream.gaps) for stream in contents.streams] == [(4, 1)]


def test_a_recording_of_hits_alone_has_no_stream(make_recording):
    maker = make_recording()
    maker.add_setup()
    maker.add_block(1)
    assert inspect_recording(maker.close()).streams == ()
