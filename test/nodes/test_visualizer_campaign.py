"""The campaign that is shown, as the topics tell it."""

from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import CONTROL_SAMPLE, PAPER_SETUP
from impact_rig.core.session import Session
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.nodes import interfaces, messages, result_messages
from impact_rig.nodes.identity import NO_IDENTITY
from impact_rig.nodes.visualizer import ShownCampaign
from impact_rig.results.campaign import results_from_session
from impact_rig.results.traces import align_hit, sample_traces_from_estimate

NAMES = ("steel small", CONTROL_SAMPLE)
STAMP = messages.stamp_to_msg(10**18)


class Told:
    """A session, and the messages in which the estimator tells of it."""

    def __init__(self):
        self.session = Session(PAPER_SETUP)
        self.verdicts, self.traces, self.truths, self.faults = [], [], [], {}
        rig = VirtualRig(PAPER_SETUP, VirtualRigSettings())
        for record, name in enumerate(NAMES, start=1):
            hit = rig.strike(HitLabel(name, record))
            truth = messages.virtual_hit_to_msg(hit, STAMP)
            self.truths.append(interfaces.VIRTUAL_IMPACT.convert(truth))
            self.faults[record] = tuple(fault.value for fault in hit.faults)
            for block in hit.split(5000, 0):
                for judged in self.session.feed(block):
                    verdict = result_messages.hit_to_msg(judged, NO_IDENTITY)
                    self.verdicts.append(interfaces.IMPACT.convert(verdict))
                    aligned = align_hit(judged.label, judged.filtered)
                    message = result_messages.trace_to_msg(
                        judged, aligned, (2000.0, 4000.0), NO_IDENTITY
                    )
                    self.traces.append(interfaces.IMPACT_TRACE.convert(message))
        self.found = self.session.estimate_all()

    def tell(self):
        """Return the campaign as it is shown."""
        campaign = ShownCampaign(PAPER_SETUP)
        for found in (*self.truths, *self.verdicts):
            campaign.add(found)
        hammer = result_messages.estimate_to_msg(self.found.hammer, STAMP, NO_IDENTITY)
        campaign.add(interfaces.HAMMER_ESTIMATE.convert(hammer))
        for estimate in self.found.samples:
            for comparison in estimate.comparisons:
                message = result_messages.comparison_to_msg(
                    estimate, comparison, STAMP, NO_IDENTITY
                )
                campaign.add(interfaces.COMPARISON.convert(message))
            message = result_messages.estimate_to_msg(estimate, STAMP, NO_IDENTITY)
            campaign.add(interfaces.ESTIMATE.convert(message))
        return campaign


@pytest.fixture(scope="module")
def told():
    return Told()


def test_results_are_those_of_the_session(told):
    assert told.tell().make_results() == results_from_session(told.found, told.faults)


def test_traces_are_those_of_the_session(told):
    campaign = told.tell()
    for estimate in told.found.samples:
        expected = sample_traces_from_estimate(estimate, told.session.compute_mean(estimate.name))
        shown = campaign.make_traces(estimate.name)
        # Told in single precision.
        tolerance = 1e-6 * np.abs(expected.mean).max()
        np.testing.assert_allclose(shown.mean, expected.mean, rtol=0, atol=tolerance)
        np.testing.assert_allclose(shown.time, expected.time, rtol=0, atol=1e-12)
        assert [model.model for model in shown.models] == [
            model.model for model in expected.models
        ]
        for model, other in zip(shown.models, expected.models, strict=True):
            np.testing.assert_allclose(model.traces, other.traces, rtol=0, atol=tolerance)
            assert model.mse_percent == other.mse_percent
        for name in ("contact_time", "half_amplitude_width", "second_peak_time"):
            assert getattr(shown, name) == pytest.approx(getattr(expected, name), nan_ok=True)


def test_of_a_long_series_ever_fewer_hits_of_each_sample_are_shown(told):
    shown = ShownCampaign(PAPER_SETUP)
    for traces in told.traces:
        assert sum(shown.is_laid_over(traces) for _ in range(120)) == 99 + 3


def test_an_endless_campaign_keeps_its_newest_hits(told):
    shown = ShownCampaign(PAPER_SETUP, largest=3)
    for record in range(1, 6):
        shown.add(replace(told.verdicts[0], record=record))
    assert [hit.record for hit in shown.make_results().hits] == [3, 4, 5]
