"""Flat results of a session."""

import math
from collections.abc import Callable
from dataclasses import fields

import pytest

from impact_rig.core.damping.log_decrement import LogDecrement
from impact_rig.core.estimation.comparison import ModelComparison, TraceComparison
from impact_rig.core.estimation.paper_method import BodyEstimate, ContactEstimate
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.hits.reasons import Reason, Rejection
from impact_rig.core.model.impact import ModelVariant
from impact_rig.core.session import SessionResults
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.signals.record import HitLabel
from impact_rig.core.uncertainty.results import BudgetLine, Uncertainty
from impact_rig.results.campaign import Results
from impact_rig.results.estimates import BudgetLineResults, SampleResults
from impact_rig.results.flat_estimates import results_from_session, sample_results_from_estimate


def make_comparison(variant: ModelVariant, first: float) -> ModelComparison:
    """Return a comparison whose figures are `first` and those after it."""
    hammer = TraceComparison((), (), -1e3, first, first + 1, first + 2)
    specimen = TraceComparison((), (), 2e3, first + 3, first + 4, first + 5)
    return ModelComparison(variant, 1e6, 0.0, 1e-4, hammer, specimen)


def make_uncertainty(first: float) -> Uncertainty:
    """Return an uncertainty whose figures are `first` and those after it."""
    return Uncertainty(first, first + 1, 9.0, (BudgetLine("mass", "B", first + 2, first + 3),))


def test_every_figure_lands_in_its_own_field() -> None:
    estimate = SampleEstimate(
        name="tin",
        impacts_accepted=1,
        impacts_rejected=2,
        contact=ContactEstimate(
            3.0, 4.0, 5.0, 6.0, make_uncertainty(40.0), make_uncertainty(50.0)
        ),
        contact_time_spread=7.0,
        body=BodyEstimate(
            8.0,
            9.0,
            10.0,
            11.0,
            LogDecrement(14.0, 15.0, 1, 2),
            (),
            *map(make_uncertainty, (60.0, 70.0, 80.0)),
        ),
        hammer_peak=12.0,
        specimen_peak=13.0,
        first_peak_time=16.0,
        second_peak_time=17.0,
        comparisons=(
            make_comparison(ModelVariant.PRINTED, 30.0),
            make_comparison(ModelVariant.DRIVEN, 20.0),
        ),
        warnings=("a warning",),
        notes=("a note",),
    )
    assert sample_results_from_estimate(estimate) == SampleResults(
        name="tin",
        impacts_accepted=1,
        impacts_rejected=2,
        half_amplitude_width_s=3.0,
        width_ratio=4.0,
        contact_time_s=5.0,
        equivalent_stiffness_n_per_m=6.0,
        contact_time_spread_s=7.0,
        stiffness_n_per_m=8.0,
        log_decrement=9.0,
        first_peak_m_per_s2=14.0,
        second_peak_m_per_s2=15.0,
        first_peak_time_s=16.0,
        second_peak_time_s=17.0,
        damping_ratio=10.0,
        damping_coefficient_n_s_per_m=11.0,
        contact_time_u_s=40.0,
        contact_time_expanded_s=41.0,
        equivalent_stiffness_u_n_per_m=50.0,
        equivalent_stiffness_expanded_n_per_m=51.0,
        stiffness_u_n_per_m=60.0,
        stiffness_expanded_n_per_m=61.0,
        damping_ratio_u=70.0,
        damping_ratio_expanded=71.0,
        damping_coefficient_u_n_s_per_m=80.0,
        damping_coefficient_expanded_n_s_per_m=81.0,
        budget=(
            BudgetLineResults("contact_time", "mass", "B", 42.0, 43.0),
            BudgetLineResults("stiffness", "mass", "B", 62.0, 63.0),
            BudgetLineResults("damping_ratio", "mass", "B", 72.0, 73.0),
            BudgetLineResults("damping_coefficient", "mass", "B", 82.0, 83.0),
        ),
        warnings=("a warning",),
        notes=("a note",),
        hammer_peak_m_per_s2=12.0,
        specimen_peak_m_per_s2=13.0,
        shift_hammer_s=20.0,
        mse_hammer_percent=21.0,
        contact_error_hammer_percent=22.0,
        shift_sample_s=23.0,
        mse_sample_percent=24.0,
        contact_error_sample_percent=25.0,
        printed_mse_hammer_percent=31.0,
        printed_mse_sample_percent=34.0,
    )


def test_what_is_not_determined_is_nan() -> None:
    sample = sample_results_from_estimate(SampleEstimate("tin", 0, 3))
    values = [getattr(sample, item.name) for item in fields(sample)]
    assert all(math.isnan(value) for value in values if isinstance(value, float))


def test_rejections_come_by_record_with_reasons_and_injected_faults() -> None:
    def reject(record: int, *reasons: Reason) -> JudgedHit:
        label = HitLabel("brass small", record, impact=4, attempt=2)
        return JudgedHit(label, tuple(Rejection(reason, "so it is") for reason in reasons))

    session = SessionResults(
        PAPER_SETUP,
        BodyEstimate(),
        (),
        (),
        (reject(12, Reason.GAP), reject(5, Reason.WEAK, Reason.OVERLOAD)),
    )
    first, second = results_from_session(session, {5: ("weak_hit",), 7: ("overload",)}).rejections
    assert (first.record, first.sample, first.impact, first.attempt) == (5, "brass small", 4, 2)
    assert first.reasons == ("weak: so it is", "overload: so it is")
    assert first.injected_faults == ("weak_hit",)
    assert (second.record, second.injected_faults) == (12, ())


def test_the_hammer_names_its_control_sample(results: Results) -> None:
    assert results.hammer.control_sample == "aluminium large"
    # Two hits of 0.3 % scatter in tau_p, twice that in k: within four standard errors.
    assert results.hammer.stiffness_n_per_m == pytest.approx(22.54e6, rel=0.02)


def test_one_seed_gives_one_result(strike: Callable[..., Results]) -> None:
    first, second = (strike(["aluminium large", "steel small"], seed=7) for _ in range(2))
    assert repr(first) == repr(second)
    assert repr(first) != repr(strike(["aluminium large", "steel small"], seed=8))
