"""The estimator node says what the core says, bit for bit, hit by hit."""

import math

from impact_rig_msgs.srv import GetResults

from impact_rig.core.session import Session
from impact_rig.core.setup.paper import CONTROL_SAMPLE, PAPER_SETUP
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.faults import Fault, FaultPlan, ScheduledFault
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.nodes import interfaces
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.messages import block_to_msg, setup_to_msg, stamp_to_msg
from impact_rig.reporting.flat_estimates import results_from_session

SETUP = setup_to_msg(PAPER_SETUP, stamp_to_msg(7))


def make_blocks(sample, count, first_record=1, faults=()):
    settings = VirtualRigSettings(faults=FaultPlan(scheduled=tuple(faults)))
    rig = VirtualRig(PAPER_SETUP, settings)
    return [
        block
        for i in range(count)
        for block in rig.strike(HitLabel(sample, record=first_record + i, impact=i + 1)).split(
            1000, 0
        )
    ]


def feed(harness, publisher, blocks):
    harness.wait_until(lambda: publisher.get_subscription_count() >= 1)
    for block in blocks:
        publisher.publish(block_to_msg(block))


def test_estimates_equal_the_core_bit_for_bit(harness):
    harness.add(EstimatorNode)
    impacts = harness.listen(interfaces.IMPACT)
    estimates = harness.listen(interfaces.ESTIMATE)
    harness.advertise(interfaces.SETUP).publish(SETUP)
    blocks = make_blocks("steel small", 2) + make_blocks(CONTROL_SAMPLE, 2, first_record=3)

    feed(harness, harness.advertise(interfaces.ACCELERATION), blocks)

    impacts.wait_for_count(4)
    estimates.wait(
        lambda got: any(
            message.sample == CONTROL_SAMPLE and message.impacts_accepted == 2 for message in got
        )
    )
    session = Session(PAPER_SETUP)
    for block in blocks:
        session.feed(block)
    expected = {
        item.name: item for item in results_from_session(session.estimate_all(), {}).samples
    }
    answer = harness.call(GetResults, interfaces.GET_RESULTS)
    assert answer.setup_stamp == SETUP.header.stamp
    assert [item.sample for item in answer.samples] == [CONTROL_SAMPLE, "steel small"]
    for item in answer.samples:
        assert item.stiffness == expected[item.sample].stiffness_n_per_m
        assert item.damping_coefficient == expected[item.sample].damping_coefficient_n_s_per_m
        assert item.mse_sample_percent == expected[item.sample].mse_sample_percent


def test_a_sample_gets_its_stiffness_as_soon_as_the_control_sample_is_measured(harness):
    harness.add(EstimatorNode)
    estimates = harness.listen(interfaces.ESTIMATE)
    harness.advertise(interfaces.SETUP).publish(SETUP)
    publisher = harness.advertise(interfaces.ACCELERATION)

    feed(harness, publisher, make_blocks("steel small", 1))
    (first,) = estimates.wait_for_count(1)
    assert math.isnan(first.stiffness)
    assert "has no accepted hit yet" in first.notes[0]

    feed(harness, publisher, make_blocks(CONTROL_SAMPLE, 1, first_record=2))
    later = estimates.wait(lambda got: got[-1].sample == "steel small" and len(got) == 3)
    assert later[-1].stiffness > 0


def test_blocks_that_come_before_the_set_up_wait_for_it(harness):
    harness.add(EstimatorNode)
    impacts = harness.listen(interfaces.IMPACT)
    feed(harness, harness.advertise(interfaces.ACCELERATION), make_blocks("steel small", 1))
    harness.advertise(interfaces.SETUP).publish(SETUP)
    (impact,) = impacts.wait_for_count(1)
    assert impact.accepted


def test_every_rejection_is_published_with_its_reason(harness):
    harness.add(EstimatorNode)
    impacts = harness.listen(interfaces.IMPACT)
    harness.advertise(interfaces.SETUP).publish(SETUP)
    faults = [ScheduledFault(fault, impact) for impact, fault in enumerate(Fault, start=1)]

    feed(
        harness,
        harness.advertise(interfaces.ACCELERATION),
        make_blocks("brass large", len(faults), faults=faults),
    )

    verdicts = impacts.wait_for_count(len(faults))
    assert [verdict.accepted for verdict in verdicts] == [False] * len(faults)
    assert [verdict.reasons[0].partition(":")[0] for verdict in verdicts] == [
        "double_hit", "overload", "weak", "no_trigger", "dead_channel", "gap",
    ]  # fmt: skip


def test_a_new_set_up_starts_the_estimates_afresh(harness):
    harness.add(EstimatorNode)
    impacts = harness.listen(interfaces.IMPACT)
    setup = harness.advertise(interfaces.SETUP)
    setup.publish(SETUP)
    feed(harness, harness.advertise(interfaces.ACCELERATION), make_blocks("steel small", 1))
    impacts.wait_for_count(1)
    assert len(harness.call(GetResults, interfaces.GET_RESULTS).samples) == 1

    again = setup_to_msg(PAPER_SETUP, stamp_to_msg(8))
    setup.publish(again)

    harness.wait_until(
        lambda: harness.call(GetResults, interfaces.GET_RESULTS).setup_stamp == again.header.stamp
    )
    assert not harness.call(GetResults, interfaces.GET_RESULTS).samples


def test_a_block_that_cannot_be_meant_is_named_and_the_next_ones_are_judged(harness):
    node = harness.add(EstimatorNode)
    impacts = harness.listen(interfaces.IMPACT)
    harness.advertise(interfaces.SETUP).publish(SETUP)
    publisher = harness.advertise(interfaces.ACCELERATION)
    bad = block_to_msg(make_blocks("steel small", 1)[0])
    bad.sampling_rate = -1.0
    harness.wait_until(lambda: publisher.get_subscription_count() >= 1)
    publisher.publish(bad)

    feed(harness, publisher, make_blocks("steel small", 1, first_record=2))

    assert impacts.wait_for_count(1)[-1].accepted
    assert "sampling rate is -1.0 Hz" in node.fault
