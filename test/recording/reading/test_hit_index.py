"""The hits of a recording are found by the heads of their blocks, and read one at a time."""

import tracemalloc

import pytest

from impact_rig.core.errors import FileError
from impact_rig.recording.reading.hit_index import index_hits, read_hit
from impact_rig.recording.reading.mcap_reader import read_recording


@pytest.mark.parametrize("name", ["session.mcap", "session"])
def test_hits_are_found_by_campaign_and_read_as_they_were(make_recording, name):
    maker = make_recording(name, chunk_size=2000)
    maker.add_setup()
    for record in (1, 2):
        for first_sample in (0, 100, 300):
            maker.add_block(record, first_sample=first_sample, last=first_sample == 300)
    maker.add_setup(name="second")
    maker.add_block(1)
    recording = read_recording(maker.close())
    first, second = index_hits(recording)
    assert [hit.label.record for hit in first] == [1, 2]
    assert [hit.label.record for hit in second] == [1]
    blocks = read_hit(recording, first[1])
    assert [block.first_sample for block in blocks] == [0, 100, 300]
    assert {block.label for block in blocks} == {first[1].label}
    assert blocks[0].hammer.output[0] == 2
    assert len(read_hit(recording, second[0])) == 1


def test_a_recording_that_was_never_closed_is_read_as_well(make_recording):
    maker = make_recording(chunk_size=2000)
    maker.add_setup()
    for record in range(1, 8):
        maker.add_block(record, points=1000)
    whole = maker.close()
    cut = whole.with_name("cut.mcap")
    cut.write_bytes(whole.read_bytes()[:-3000])
    recording = read_recording(cut)
    assert recording.warnings
    (hits,) = index_hits(recording)
    assert hits
    assert read_hit(recording, hits[-1])[0].label == hits[-1].label


def test_the_points_of_the_others_stay_on_the_disk(make_recording):
    points, records = 20_000, 50
    maker = make_recording(compression="none", chunk_size=100_000)
    maker.add_setup()
    for record in range(1, records + 1):
        maker.add_block(record, points=points)
    path = maker.close()
    tracemalloc.start()
    try:
        recording = read_recording(path)
        (hits,) = index_hits(recording)
        read_hit(recording, hits[-1])
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(hits) == records
    assert peak < path.stat().st_size / 4


def test_a_block_that_is_none_is_named(make_recording):
    maker = make_recording()
    maker.add_setup()
    maker.add_block(1)
    channel = maker._channels["acceleration"]
    maker.writer.add_message(channel, b"\0\1\0\0", 2 * 10**18, 2 * 10**18)
    with pytest.raises(FileError, match=r"session.mcap: /acceleration: a block of 4 byte"):
        index_hits(read_recording(maker.close()))


def test_a_hit_that_is_no_longer_there_is_missed(make_recording):
    maker = make_recording()
    maker.add_setup()
    maker.add_block(1)
    ((hit,),) = index_hits(read_recording(maker.close()))
    other = make_recording("other.mcap")
    other.add_setup()
    other.add_block(2)
    with pytest.raises(FileError, match="no longer holds record 1 of 'brass'"):
        read_hit(read_recording(other.close()), hit)
