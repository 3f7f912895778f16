"""What of a campaign cannot be shown is said, with the reason."""

from dataclasses import replace

from impact_rig.cli.recordings.view_parts import find_remarks
from impact_rig.results.traced_campaign import TracedCampaign


def test_a_sample_without_a_good_hit_is_named(strike):
    results = strike(["steel small"], impacts=1, fault_probability=1.0)
    assert not results.hits[0].accepted

    (remark,) = find_remarks(TracedCampaign(results, (), ()))
    assert remark.startswith("'steel small' is shown without mean and model: ")
    assert "none of 1 hits was accepted" in remark


def test_a_sample_without_model_is_named(results):
    sample = replace(results.samples[0], notes=("k1: no control sample",))
    campaign = TracedCampaign(replace(results, samples=(sample,)), (make_bare_traces(sample),), ())

    (remark,) = find_remarks(campaign)
    assert remark == f"{sample.name!r} is shown without model: k1: no control sample"


def make_bare_traces(sample):
    from impact_rig.results.sample_traces import SampleTraces

    return SampleTraces(sample.name, 1e6, 0.0, None, 1e-4, 5e-5, 0.0, 0.0, ())
