"""What a session found, as it leaves the core."""

from impact_rig.core.hits import JudgedHit
from impact_rig.core.paper_method import HammerEstimate
from impact_rig.core.records import HitLabel
from impact_rig.core.session import SessionResults
from impact_rig.core.setup import PAPER_SETUP
from impact_rig.core.verdict import Finding, Reason
from impact_rig.results.campaign import results_from_session


def test_rejections_come_by_record_with_reasons_and_injected_faults():
    def reject(record: int, *reasons: Reason) -> JudgedHit:
        label = HitLabel("brass small", record, impact=4, attempt=2)
        return JudgedHit(label, tuple(Finding(reason, "so it is") for reason in reasons))

    session = SessionResults(
        PAPER_SETUP,
        HammerEstimate(),
        (),
        (),
        (reject(12, Reason.GAP), reject(5, Reason.WEAK, Reason.OVERLOAD)),
    )
    first, second = results_from_session(session, {5: ("weak_hit",), 7: ("overload",)}).rejections
    assert (first.record, first.sample, first.impact, first.attempt) == (5, "brass small", 4, 2)
    assert first.reasons == ("weak: so it is", "overload: so it is")
    assert first.injected_faults == ("weak_hit",)
    assert (second.record, second.injected_faults) == (12, ())


def test_traces_stay_in_the_core(results):
    assert all(sample.comparisons == () for sample in results.samples)
    assert results.hammer.known_stiffness is None
