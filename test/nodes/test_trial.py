"""A trial hit: struck and judged like every other, and in no result."""

import pytest

from impact_rig.analysis.analyze import analyze
from impact_rig.core.given.errors import FileError
from impact_rig.nodes import interfaces
from impact_rig.nodes.campaign_plan import read_newest_campaign
from impact_rig.recordings.contents import inspect_run
from impact_rig.recordings.run import Run

from .campaigns import run, start_rig

NAME = "steel small"


def count_verdicts(path):
    """Return how many verdicts can be looked at, those of trials among them."""
    topic = inspect_run(Run(path)).topics.get("/impact")
    return topic.messages if topic else 0


def test_a_trial_hit_is_recorded_and_does_not_count(harness):
    client = start_rig(harness)
    verdicts = harness.listen(interfaces.IMPACT)
    trial = run(harness, client, samples=[NAME], impacts=1, trial=True).result
    assert trial.success, trial.message
    assert verdicts.wait_for_count(1)[0].hammer_peak > 0.0
    with pytest.raises(FileError, match="holds no campaign that could go on"):
        read_newest_campaign(harness.recording)

    counted = run(harness, client, samples=[NAME], impacts=2).result
    assert counted.success, counted.message
    campaign = read_newest_campaign(harness.recording)
    assert campaign.campaign_id == counted.setup.campaign_id
    again = run(harness, client, samples=[NAME], impacts=1, trial=True).result
    assert again.success, again.message

    # The last verdict comes to the recorder by a way of its own.
    harness.wait_until(lambda: count_verdicts(harness.recording) == 4)
    read = Run(harness.recording)
    (found,) = analyze(read).campaigns
    assert [hit.record for hit in found.results.hits] == [2, 3]
    contents = inspect_run(read)
    assert [hit.record for hit in contents.hits if hit.blocks] == [2, 3]
