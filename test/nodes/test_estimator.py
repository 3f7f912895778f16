"""The estimator node says what the core says, bit for bit, hit by hit."""

import signal

import pytest
from impact_rig_msgs.msg import Finding, RecordStored
from impact_rig_msgs.srv import GetResults, JoinCampaign

from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import CONTROL_SAMPLE, PAPER_SETUP
from impact_rig.core.session import Session
from impact_rig.devices.virtual.rig import DigitizerSettings, VirtualRig, VirtualRigSettings
from impact_rig.nodes import interfaces
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.identity import NO_IDENTITY, Identity, id_to_msg, make_id
from impact_rig.nodes.messages import block_to_msg, setup_to_msg, stamp_to_msg
from impact_rig.results.campaign import results_from_session

from .replays import write_recording

SETUP = setup_to_msg(PAPER_SETUP, stamp_to_msg(7))


def make_blocks(sample, count, first_record=1, stamp=0):
    rig = VirtualRig(PAPER_SETUP, VirtualRigSettings())
    return [
        block
        for i in range(count)
        for block in rig.strike(HitLabel(sample, record=first_record + i, impact=i + 1)).split(
            1000, stamp
        )
    ]


def feed(harness, publisher, blocks, identity=NO_IDENTITY):
    harness.wait_until(lambda: publisher.get_subscription_count() >= 1)
    for block in blocks:
        publisher.publish(block_to_msg(block, identity))


@pytest.fixture
def estimator(harness):
    """Return an estimator that knows the set-up, a publisher of blocks, and the verdicts."""
    node = harness.add(EstimatorNode)
    impacts = harness.listen(interfaces.IMPACT)
    harness.advertise(interfaces.SETUP).publish(SETUP)
    return node, harness.advertise(interfaces.ACCELERATION), impacts


def test_estimates_equal_the_core_bit_for_bit(harness, estimator):
    _, publisher, impacts = estimator
    estimates = harness.listen(interfaces.ESTIMATE)
    blocks = make_blocks("steel small", 2) + make_blocks(CONTROL_SAMPLE, 2, first_record=3)

    feed(harness, publisher, blocks)

    impacts.wait_for_count(4)
    estimates.wait(
        lambda got: any(
            message.name == CONTROL_SAMPLE and message.impacts_accepted == 2 for message in got
        )
    )
    session = Session(PAPER_SETUP)
    for block in blocks:
        session.feed(block)
    expected = {
        item.name: item for item in results_from_session(session.estimate_all(), {}).samples
    }
    answer = harness.call(GetResults, interfaces.GET_RESULTS)
    assert answer.setup.header == SETUP.header
    assert [item.name for item in answer.samples] == [CONTROL_SAMPLE, "steel small"]
    for item in answer.samples:
        assert item.stiffness.value == expected[item.name].paper.stiffness.value
        assert (
            item.damping_coefficient.value == expected[item.name].paper.damping_coefficient.value
        )
        assert item.mse_sample_percent == expected[item.name].errors.mse_sample_percent


def test_records_without_a_set_up_are_told_until_one_comes(harness):
    node = harness.add(EstimatorNode)
    impacts = harness.listen(interfaces.IMPACT)
    feed(harness, harness.advertise(interfaces.ACCELERATION), make_blocks(CONTROL_SAMPLE, 1))
    harness.wait_until(lambda: node.describe_warning() is not None)
    told = node.describe_warning()
    assert told.startswith("records come on /acceleration and no set-up on /setup")
    harness.advertise(interfaces.SETUP).publish(SETUP)
    assert impacts.wait_for_count(1)[0].accepted
    assert node.describe_warning() is None


def test_all_that_is_found_carries_the_id_of_its_campaign(harness):
    harness.add(EstimatorNode)
    topics = (
        interfaces.IMPACT, interfaces.ESTIMATE, interfaces.HAMMER_ESTIMATE, interfaces.COMPARISON
    )  # fmt: skip
    told = [harness.listen(topic) for topic in topics]
    setups = harness.advertise(interfaces.SETUP)
    publisher = harness.advertise(interfaces.ACCELERATION)
    for number in (1, 2):
        identity = Identity(make_id())
        setup = setup_to_msg(PAPER_SETUP, stamp_to_msg(number))
        identity.fill(setup)
        setups.publish(setup)
        feed(harness, publisher, make_blocks(CONTROL_SAMPLE, 1, first_record=number), identity)
        for collector in told:
            collector.wait(
                lambda got, setup=setup: got[-1:] and got[-1].campaign_id == setup.campaign_id
            )
        results = harness.call(GetResults, interfaces.GET_RESULTS)
        for found in (results.setup, results.hammer, *results.samples, *results.accepted):
            assert found.campaign_id == setup.campaign_id


def test_results_are_answered_once_all_who_listen_have_them_or_do_not_take_them(
    harness, estimator, start_process, tmp_path
):
    node, publisher, impacts = estimator
    listener = start_process("recorder", output=tmp_path / "session.mcap").process
    harness.wait_until(lambda: node._estimate.get_subscription_count() == 1)
    feed(harness, publisher, make_blocks(CONTROL_SAMPLE, 1))
    impacts.wait_for_count(1)
    listener.send_signal(signal.SIGSTOP)
    node.patience = 0.0
    assert harness.call(GetResults, interfaces.GET_RESULTS).samples
    node.patience = 1000.0
    answers = harness.make_collector()
    client = harness.run(lambda: harness.peer.create_client(GetResults, interfaces.GET_RESULTS))
    harness.wait_until(client.service_is_ready)
    client.call_async(GetResults.Request()).add_done_callback(answers.take)
    assert not answers.has_come(1.0)
    listener.send_signal(signal.SIGCONT)
    answers.wait_for_count(1)


def test_what_the_control_sample_changes_follows_once_and_behind_its_hits(harness, estimator):
    _, publisher, impacts = estimator
    estimates = harness.listen(interfaces.ESTIMATE)
    others = ("steel small", "brass small", "bronze small")
    blocks = [
        block
        for number, sample in enumerate(others, start=1)
        for block in make_blocks(sample, 1, first_record=number)
    ]
    feed(harness, publisher, blocks)
    estimates.wait_for_count(2 * len(others))
    feed(harness, publisher, make_blocks(CONTROL_SAMPLE, 4, first_record=4))
    found = estimates.wait_for_count(6 + 4 + 4)
    assert len(impacts.messages) == len(others) + 4
    # Numbers of each hit at once; then, when no more come, each sample's once, as it is complete.
    assert [item.name for item in found[6:10]] == 4 * [CONTROL_SAMPLE]
    assert not any(item.pulse_shape.fits for item in found[6:10])
    assert sorted(item.name for item in found[10:]) == sorted((CONTROL_SAMPLE, *others))
    assert all(item.pulse_shape.fits for item in found[10:])
    # Of each the newest state: all four hits on the control sample make it.
    answer = harness.call(GetResults, interfaces.GET_RESULTS)
    final = {item.name: item.stiffness.value for item in answer.samples}
    assert {item.name: item.stiffness.value for item in found[10:]} == final


def test_a_hit_of_another_rate_than_the_others_is_rejected_by_name(harness, estimator):
    node, publisher, impacts = estimator
    feed(harness, publisher, make_blocks(CONTROL_SAMPLE, 1))
    slower = VirtualRigSettings(digitizer=DigitizerSettings(sampling_rate=1.25e6))
    hit = VirtualRig(PAPER_SETUP, slower).strike(HitLabel(CONTROL_SAMPLE, record=2, impact=2))
    feed(harness, publisher, hit.split(1000, 0))
    verdicts = impacts.wait_for_count(2)
    assert [verdict.accepted for verdict in verdicts] == [True, False]
    told = "sampled at 1250000 Hz, the hits before sampled at 2500000 Hz"
    assert verdicts[1].reasons == [Finding(reason="other_kind", explanation=told)]
    assert not node.fault


OURS = Identity(make_id(), make_id())
OUR_SETUP = setup_to_msg(PAPER_SETUP, stamp_to_msg(7))
OURS.fill(OUR_SETUP)


def join(harness, recording):
    """Start an estimator that takes part in a recorded campaign."""
    node = harness.add(EstimatorNode)
    request = JoinCampaign.Request(
        setup=OUR_SETUP, stream_id=id_to_msg(OURS.stream_id), recording=str(recording)
    )
    assert harness.call(JoinCampaign, interfaces.make_join_name("estimator"), request).success
    return node


def test_a_hit_is_judged_when_the_recorder_has_stored_it(harness):
    node = join(harness, "/elsewhere/session.mcap")
    publisher, stored = map(harness.advertise, (interfaces.ACCELERATION, interfaces.RECORD_STORED))
    impacts = harness.listen(interfaces.IMPACT)
    blocks = make_blocks("steel small", 1)
    feed(harness, publisher, blocks, OURS)
    harness.wait_until(lambda: "record 1 is stored" in node.diagnose()["waiting for"])
    assert not impacts.messages
    message = RecordStored(record=1, blocks=len(blocks))
    OURS.fill(message)
    stored.publish(message)
    assert impacts.wait_for_count(1)[0].accepted
    assert not node.diagnose()["waiting for"]


def test_what_the_run_has_on_the_disk_is_known_and_counts_once(harness, tmp_path):
    """As after a kill of all nodes: the recordings are what is left."""
    blocks = make_blocks("steel small", 3)
    paths = [tmp_path / "session.mcap", tmp_path / "session-2.mcap"]
    for path, records in zip(paths, [(1,), (2, 3)], strict=True):
        theirs = [
            (0.0, interfaces.ACCELERATION, block_to_msg(block, OURS))
            for block in blocks
            if block.label.record in records
        ]
        write_recording(path, [(0.0, interfaces.SETUP, OUR_SETUP), *theirs])
    node = join(harness, paths[-1])
    impacts = harness.listen(interfaces.IMPACT)
    publisher = harness.advertise(interfaces.ACCELERATION)
    feed(harness, publisher, [item for item in blocks if item.label.record == 3], OURS)
    counts = GetResults.Request(counts_only=True)
    answer = harness.call(GetResults, interfaces.GET_RESULTS, counts)
    assert [(item.sample, item.accepted, item.rejected) for item in answer.counts] == [
        ("steel small", 3, 0)
    ]
    assert (answer.newest_record, answer.waiting_record) == (3, 0)
    assert not impacts.messages
    results = harness.call(GetResults, interfaces.GET_RESULTS)
    session = Session(PAPER_SETUP)
    for block in blocks:
        session.feed(block)
    (expected,) = session.estimate_all().samples
    assert results.samples[0].contact_time.value == expected.paper.contact_time.value
    assert not node.fault
