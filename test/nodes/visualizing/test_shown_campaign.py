"""The topics of a campaign add up to the results and traces of its session."""

import math

import numpy as np
import pytest

from impact_rig.core.errors import SignalError
from impact_rig.core.session import Session
from impact_rig.core.setup.paper import CONTROL_SAMPLE, PAPER_SETUP
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.nodes import estimate_messages, messages
from impact_rig.nodes.visualizing import shown_campaign
from impact_rig.nodes.visualizing.shown_campaign import ShownCampaign
from impact_rig.results.flat_estimates import results_from_session
from impact_rig.results.sample_traces import sample_traces_from_estimate

NAMES = ("steel small", CONTROL_SAMPLE)
STAMP = messages.stamp_to_msg(10**18)
STARTED = 10**18 - 7
SETUP_STAMP = messages.stamp_to_msg(STARTED)


class Told:
    """A session, and the messages in which the estimator tells of it."""

    def __init__(self):
        self.session = Session(PAPER_SETUP)
        self.verdicts, self.truths, self.faults = [], [], {}
        rig = VirtualRig(PAPER_SETUP, VirtualRigSettings())
        for record, name in enumerate(NAMES, start=1):
            hit = rig.strike(HitLabel(name, record))
            self.truths.append(messages.virtual_hit_to_msg(hit, STAMP))
            self.faults[record] = tuple(fault.value for fault in hit.faults)
            for block in hit.split(5000, 0):
                for judged in self.session.feed(block):
                    self.verdicts.append(estimate_messages.hit_to_msg(judged, SETUP_STAMP))
        self.found = self.session.estimate_all_without_models()

    def tell(self, campaign, *, with_peaks=True):
        for message in self.truths:
            campaign.add_truth(message)
        for message in self.verdicts:
            campaign.add_hit(message)
        campaign.add_hammer(
            estimate_messages.hammer_to_msg(self.found.hammer, CONTROL_SAMPLE, STAMP, SETUP_STAMP)
        )
        for estimate in self.found.samples:
            self.tell_comparisons(campaign, estimate, with_peaks=with_peaks)
            campaign.add_estimate(estimate_messages.estimate_to_msg(estimate, STAMP, SETUP_STAMP))

    @staticmethod
    def tell_comparisons(campaign, estimate, *, with_peaks):
        for comparison in estimate.comparisons:
            message = estimate_messages.comparison_to_msg(estimate, comparison, STAMP, SETUP_STAMP)
            if not with_peaks:
                message.hammer_peak = message.specimen_peak = math.nan
            campaign.add_comparison(message)


@pytest.fixture(scope="module")
def told():
    return Told()


@pytest.fixture
def campaign(told):
    shown = ShownCampaign(PAPER_SETUP, STARTED)
    told.tell(shown)
    return shown


def test_results_are_those_of_the_session(told, campaign):
    assert campaign.make_results() == results_from_session(told.found, told.faults)


def test_traces_are_those_of_the_session(told, campaign):
    for estimate in told.found.samples:
        expected = sample_traces_from_estimate(estimate, told.session.find_mean(estimate.name))
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
            assert model.mse_sample_percent == other.mse_sample_percent
        for name in ("contact_time", "half_amplitude_width", "second_peak_time"):
            assert getattr(shown, name) == pytest.approx(getattr(expected, name), nan_ok=True)


def test_an_old_recording_gets_its_scale_from_the_estimate(told):
    shown = ShownCampaign(PAPER_SETUP, STARTED)
    told.tell(shown, with_peaks=False)
    estimate = told.found.samples[0]
    peaks = np.abs(shown.make_traces(estimate.name).mean).max(axis=1)
    np.testing.assert_allclose(peaks, [estimate.hammer_peak, estimate.specimen_peak], rtol=1e-6)


def test_without_any_peak_it_is_said_that_there_is_no_scale(told):
    shown = ShownCampaign(PAPER_SETUP, STARTED)
    told.tell_comparisons(shown, told.found.samples[0], with_peaks=False)
    with pytest.raises(SignalError, match="have no scale"):
        shown.make_traces(told.found.samples[0].name)


def test_nothing_told_yet_is_a_campaign_without_hits():
    results = ShownCampaign(PAPER_SETUP, STARTED).make_results()
    assert results.setup.name == PAPER_SETUP.name
    assert (results.samples, results.hits) == ((), ())


def test_an_endless_campaign_keeps_its_newest_hits(told, monkeypatch):
    monkeypatch.setattr(shown_campaign, "LARGEST_CAMPAIGN", 3)
    shown = ShownCampaign(PAPER_SETUP, STARTED)
    message = told.verdicts[0]
    for record in range(1, 6):
        message.record = record
        shown.add_hit(message)
    assert [hit.record for hit in shown.make_results().hits] == [3, 4, 5]
