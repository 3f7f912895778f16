"""Blocks pass when they are stored, in their order; what never will be stored is dropped."""

import pytest
from impact_rig_msgs.msg import AccelerationBlock, RecordStored, RigSetup

from impact_rig.nodes.estimator_gate import StorageGate
from impact_rig.nodes.messages import stamp_to_msg

SECOND = 1_000_000_000


def make_blocks(record, count=3, *, start=None, ends=True):
    """Return the blocks of one record, a second apart; records are a minute apart."""
    begin = (60 * record if start is None else start) * SECOND
    blocks = []
    for i in range(count):
        block = AccelerationBlock(record=record, sample="brass", last=ends and i == count - 1)
        block.header.stamp = stamp_to_msg(begin + i * SECOND)
        blocks.append(block)
    return blocks


def tell(gate, blocks, *, lacking=0):
    """Say that all these blocks are stored, but for so many in their middle."""
    message = RecordStored(record=blocks[0].record, blocks=len(blocks) - lacking)
    message.header.stamp = blocks[-1].header.stamp
    return gate.add_stored(message)


@pytest.fixture
def gate():
    gate = StorageGate()
    gate.is_open = False
    return gate


def add(gate, blocks):
    for block in blocks:
        gate.add_block(block)


def test_the_recorder_may_be_faster_than_the_blocks(gate):
    blocks = make_blocks(17)
    tell(gate, blocks)
    add(gate, blocks)
    assert list(gate.pass_on()) == blocks


def test_a_set_up_keeps_its_place_among_the_blocks(gate):
    first, second, setup = make_blocks(1), make_blocks(2), RigSetup(name="second")
    add(gate, first)
    gate.add_setup(setup)
    add(gate, second)
    assert not list(gate.pass_on())
    tell(gate, first)
    assert list(gate.pass_on()) == [*first, setup]
    tell(gate, second)
    assert list(gate.pass_on()) == second


def test_a_long_record_passes_in_parts(gate):
    blocks = make_blocks(1, 5)
    add(gate, blocks[:3])
    tell(gate, blocks[:2])
    assert list(gate.pass_on()) == blocks[:2]
    add(gate, blocks[3:])
    tell(gate, blocks)
    assert list(gate.pass_on()) == blocks[2:]


def test_what_the_recorder_did_not_get_is_dropped_when_the_next_record_is_stored(gate):
    first, second = make_blocks(1), make_blocks(2)
    add(gate, first)
    tell(gate, first, lacking=1)
    assert not list(gate.pass_on())
    add(gate, second)
    told = tell(gate, second)
    assert told == "record 1 is not evaluated: the recorder has 2 of its 3 blocks"
    assert list(gate.pass_on()) == second


def test_a_long_record_that_the_recorder_got_in_parts_only_goes_on(gate):
    blocks = make_blocks(1, 5)
    add(gate, blocks[:4])
    tell(gate, blocks[:4], lacking=1)
    assert list(gate.pass_on()) == blocks[:3]
    add(gate, blocks[4:])
    tell(gate, blocks, lacking=1)
    assert not list(gate.pass_on())
    assert gate.drop() == "record 1 is not evaluated: the recorder has 4 of its 5 blocks"


def test_a_record_without_its_last_block_passes_when_it_is_stored(gate):
    first, second = make_blocks(1, ends=False), make_blocks(2)
    add(gate, [*first, *second])
    tell(gate, first)
    assert list(gate.pass_on()) == first
    tell(gate, second)
    assert list(gate.pass_on()) == second


def test_a_word_about_a_record_of_the_same_number_before_a_restart_is_not_taken(gate):
    old, new = make_blocks(1, start=10), make_blocks(1, start=99)
    tell(gate, old)
    add(gate, new)
    assert not list(gate.pass_on())
    tell(gate, new)
    # The word on the old one may come again; it takes nothing back.
    tell(gate, old)
    assert list(gate.pass_on()) == new


def test_what_waits_when_the_recording_ends_is_dropped_by_name(gate):
    setup = RigSetup(name="next")
    add(gate, [*make_blocks(1), *make_blocks(2, 1)])
    gate.add_setup(setup)
    told = gate.drop()
    assert "record 1 is not evaluated: the recorder has 0 of its 3 blocks" in told
    assert "record 2 is not evaluated" in told
    assert list(gate.pass_on()) == [setup]
    assert gate.drop() == ""
