"""A person's verdict on a hit: struck again at once, in the recording, and the same ever after."""

import pytest
from impact_rig_msgs.msg import Finding, Overrule
from impact_rig_msgs.srv import GetResults, OverruleHit
from unique_identifier_msgs.msg import UUID

from impact_rig.analysis.analyze import analyze
from impact_rig.configuration.processes import RESULTS_NAME
from impact_rig.nodes import interfaces
from impact_rig.nodes.replay_client import ReplayClient
from impact_rig.nodes.result_messages import results_from_msg
from impact_rig.recordings.messages import OVERRULE_TYPE
from impact_rig.recordings.run import Run
from impact_rig.results.results_file import results_to_json
from impact_rig.results.wire import format_json

from .campaigns import begin, run, start_rig

NAME = "steel small"
BY_HAND = Finding(reason="operator", explanation="left out by hand, by Ann: loose cable")


@pytest.fixture
def ask(harness):
    """Return a function that overrules a hit and returns the answer."""

    def call(campaign_id, record, verdict, reason="loose cable"):
        asked = Overrule(
            campaign_id=campaign_id, record=record, verdict=verdict, reason=reason, who="Ann"
        )
        request = OverruleHit.Request(overrule=asked)
        return harness.ask(OverruleHit, interfaces.OVERRULE_HIT, request)

    return call


def write(results):
    return format_json(results_to_json(results))


def get_results(harness):
    return harness.call(GetResults, interfaces.GET_RESULTS)


def find_results(harness):
    return write(results_from_msg(get_results(harness), {}))


def analyze_again(harness):
    return write(analyze(Run(harness.recording)).campaigns[-1].results)


def test_a_hit_left_out_by_hand_is_struck_again_and_every_reader_says_the_same(harness, ask):
    client = start_rig(harness)
    verdicts = harness.listen(interfaces.IMPACT)
    handle, _ = begin(harness, client, samples=[NAME], impacts=3)
    verdicts.wait(lambda got: got)
    campaign = verdicts.messages[0].campaign_id
    answer = ask(campaign, 1, Overrule.REJECT)
    assert answer.success, answer.message
    result = harness.wait(handle.get_result_async()).result
    assert result.success, result.message
    assert [hit.record for hit in result.accepted] == [2, 3, 4]
    (rejected,) = result.rejected
    assert rejected.reasons == [BY_HAND]
    # The second verdict on the hit is the person's.
    verdicts.wait_for_count(5)
    assert [hit.accepted for hit in verdicts.messages if hit.record == 1] == [True, False]

    live = find_results(harness)
    assert '"accepted": false' in live
    assert analyze_again(harness) == live
    written = harness.recording.with_name(RESULTS_NAME)
    assert written.read_text() == live
    with ReplayClient() as replay:
        (replayed,) = replay.estimate(Run(harness.recording), lambda _: None)
    assert write(replayed) == live

    # The campaign is over: its counts are what a person's verdicts leave, and the view shows them.
    states = harness.listen(interfaces.CAMPAIGN_STATE)
    assert ask(campaign, 2, Overrule.REJECT).success
    states.wait(lambda got: [item.accepted for item in got[-1].counts] == [2])
    harness.wait_until(lambda: written.read_text() == find_results(harness) != live)
    assert ask(campaign, 2, Overrule.UNDO).success
    # Undone, and a resumed run knows of both; the recording keeps all that was decided.
    assert ask(campaign, 1, Overrule.UNDO).success
    assert [hit.record for hit in get_results(harness).accepted] == [1, 2, 3, 4]
    decided = analyze(Run(harness.recording)).campaigns[-1].overrules
    assert [item.decision for _, item in decided] == [
        "left out by hand",
        "left to the analysis again",
        "left out by hand",
        "left to the analysis again",
    ]


def test_what_cannot_be_is_refused_in_a_sentence(harness, ask):
    client = start_rig(harness)
    result = run(harness, client, samples=[NAME], impacts=1)
    campaign = result.result.setup.campaign_id
    assert "give a reason and a name" in ask(campaign, 1, Overrule.REJECT, " ").message
    for number, record, verdict, told in (
        (campaign, 9, Overrule.REJECT, "the campaign has no hit of record 9"),
        (campaign, 1, Overrule.UNDO, "record 1 is as the analysis judges it: nothing to undo"),
        (campaign, 1, 7, "verdict is 7: it must be one of 0 (undo), 1 (accept), 2 (reject)"),
        (UUID(), 1, Overrule.REJECT, "the estimator has no such campaign: it may be over"),
    ):
        answer = ask(number, record, verdict)
        assert (answer.success, answer.message) == (False, told)


def test_a_run_that_is_resumed_keeps_what_a_person_made_of_its_hits(harness, ask):
    client = start_rig(harness)
    first = run(harness, client, samples=[NAME], impacts=2).result
    assert ask(first.setup.campaign_id, 2, Overrule.REJECT).success
    # It was answered when it was on the disk.
    assert any(Run(harness.recording).read_messages({OVERRULE_TYPE}))
    # Another estimator knows of it from the recording alone.
    harness.change_state("estimator", "deactivate", "activate")
    handle, _ = begin(harness, client, resumed=first.setup)
    second = harness.wait(handle.get_result_async()).result
    assert second.success, second.message
    assert [hit.record for hit in second.accepted] == [1, 3]
    assert second.rejected[0].reasons == [BY_HAND]
    live = find_results(harness)
    assert analyze_again(harness) == live


def test_of_many_questions_at_once_each_is_answered_or_refused(harness):
    client = start_rig(harness)
    result = run(harness, client, samples=[NAME], impacts=2).result
    overrules = harness.peer.create_client(
        OverruleHit, interfaces.OVERRULE_HIT, qos_profile=interfaces.SERVICES
    )
    harness.wait_until(overrules.service_is_ready)
    asked = [
        Overrule(
            campaign_id=result.setup.campaign_id, record=1 + number % 3, verdict=Overrule.REJECT,
            reason=f"loose cable {number}", who="Ann",
        )
        for number in range(150)
    ]  # fmt: skip
    requests = [OverruleHit.Request(overrule=overrule) for overrule in asked]
    answers = [overrules.call_async(request) for request in requests]

    def is_answered(number):
        if answers[number].done() and answers[number].result().later:
            answers[number] = overrules.call_async(requests[number])
        return answers[number].done() and not answers[number].result().later

    harness.wait_until(lambda: all(map(is_answered, range(150))), 30.0)
    assert [it.result().success for it in answers] == [number % 3 < 2 for number in range(150)]
    decided = analyze(Run(harness.recording)).campaigns[-1].overrules
    assert len(decided) == 100
