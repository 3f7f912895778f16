"""Damage is made from a seed: the same each time, another with each seed, in many ways."""

import random

import pytest
from mcap.writer import CompressionType, Writer

from impact_rig.bench import mutations
from impact_rig.bench.mutations import mutate


@pytest.fixture
def recording(tmp_path) -> bytes:
    path = tmp_path / "file.mcap"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=200, compression=CompressionType.NONE)
        writer.start("ros2", "test")
        schema = writer.register_schema("a/msg/B", "ros2msg", b"uint8 x")
        channel = writer.register_channel("/b", "cdr", schema)
        for number in range(20):
            writer.add_message(channel, number, bytes([number]) * 50, number)
        writer.finish()
    return path.read_bytes()


def test_a_seed_always_gives_the_same_damage(recording):
    assert [mutate(recording, seed) for seed in range(50)] == [
        mutate(recording, seed) for seed in range(50)
    ]


def test_seeds_give_different_damage(recording):
    spoilt = {mutate(recording, seed) for seed in range(200)}
    assert len(spoilt) > 190
    assert recording not in spoilt


@pytest.mark.parametrize("way", mutations._WAYS, ids=lambda way: way.__name__)
def test_every_way_changes_a_recording_and_bears_any_other_bytes(recording, way):
    changed = 0
    for seed in range(20):
        spoilt = bytearray(recording)
        way(spoilt, random.Random(seed))
        changed += spoilt != recording
    assert changed > 10
    for other in (b"x", bytes(8), bytes(30), b"\x89MCAP0\r\n\x06" + b"\xff" * 20):
        way(bytearray(other), random.Random(1))


def test_nothing_stays_nothing():
    assert mutate(b"", 1) == b""
