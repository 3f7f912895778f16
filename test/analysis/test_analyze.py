"""What there is to see of a recording is what its analysis finds, with the traces behind it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from impact_rig.analysis.analyze import ByHand, analyze
from impact_rig.core.given.records import MEASURED, Block, HitLabel, Origin
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.devices.virtual.rig import FaultPlan, VirtualRig, VirtualRigSettings
from impact_rig.files.channels import MeasuredHit
from impact_rig.files.importing import write_imported
from impact_rig.recordings.run import Run
from impact_rig.results import remarks
from impact_rig.results.remarks import tabulate_accepted
from impact_rig.results.traces import TracedCampaign

RECORDING = Path(__file__).parents[1] / "data" / "recordings" / "b061bfb.mcap"
SAMPLES = ("aluminium large", "steel small")
LABELS = [
    HitLabel(name, record, impact)
    for record, (name, impact) in enumerate(
        ((name, impact) for name in SAMPLES for impact in (1, 2, 3, 4)), start=1
    )
]


def import_block(block: Block) -> MeasuredHit:
    return MeasuredHit(Path(__file__), block)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of two samples, some hits with faults."""
    rig = VirtualRig(PAPER_SETUP, VirtualRigSettings(seed=11, faults=FaultPlan(0.1)))
    hits = [import_block(rig.strike(label).split(10_000, 0)[0]) for label in LABELS]
    output = tmp_path_factory.mktemp("traced") / "session.mcap"
    write_imported(output, PAPER_SETUP, hits)
    return output


@pytest.fixture(scope="module")
def campaign(path: Path) -> TracedCampaign:
    """Return all that there is to see of it."""
    (found,) = analyze(Run(path), keep_traces=True).campaigns
    return found


def test_traces_that_are_kept_do_not_change_what_is_found(path, campaign):
    (analyzed,) = analyze(Run(path)).campaigns
    assert (analyzed.samples, analyzed.hits) == ((), ())
    assert repr(campaign.results.hits) == repr(analyzed.results.hits)
    pairs = zip(campaign.results.samples, analyzed.results.samples, strict=True)
    for sample, other in pairs:
        assert repr(sample.paper.stiffness) == repr(other.paper.stiffness)


def test_every_hit_is_there_as_recorded_and_in_its_sample_s_time(campaign):
    assert [hit.recorded.label for hit in campaign.hits] == LABELS
    assert [hit.result.record for hit in campaign.hits] == [label.record for label in LABELS]
    assert {hit.result.accepted for hit in campaign.hits} == {True, False}, "some should be bad"
    for hit in campaign.hits:
        assert hit.recorded.values.shape == (hit.recorded.time.size, 2)
        if hit.aligned is None:
            assert not hit.result.accepted
        else:
            peaks = np.abs(hit.aligned.traces).max(axis=1)
            assert peaks[0] == pytest.approx(hit.result.hammer_peak, rel=1e-3)


def test_hits_that_are_judged_otherwise_than_when_recorded_are_told_once():
    run = Run(RECORDING)
    assert analyze(run).warnings == ()
    by_hand = ByHand(reject=["steel small/1"])
    (told,) = analyze(run, {"minimum_peak": 0.9}, by_hand).warnings
    assert told.startswith(
        "judged otherwise than when recorded: 2 (steel small/2.1) was accepted, "
    )
    assert told.endswith(" and 2 more")  # of 8, and one is a person's
    assert "1 (steel small/1.1)" not in told


def test_of_many_hits_some_are_shown_and_how_many_more_there_are_is_said(
    path, campaign, monkeypatch
):
    (found,) = analyze(Run(path), keep_traces=True, most_traces=2).campaigns
    assert [hit.recorded.label for hit in found.hits] == LABELS[::2]  # four on each sample
    count = len([hit for hit in campaign.results.hits if hit.accepted])
    for most, told in ((count, "τp: "), (count - 1, f"The first {count - 1} hits; 1 more")):
        monkeypatch.setattr(remarks, "MOST_LISTED", most)
        (table,) = tabulate_accepted(campaign.results)
        assert table.notes[0].startswith(told)
        assert len(table.rows) == most


def test_a_mean_is_that_of_its_accepted_hits(campaign):
    for sample in campaign.samples:
        grid = sample.time[500:2000]
        hits = [
            np.interp(grid, hit.aligned.time, hit.aligned.traces[0])
            for hit in campaign.hits
            if hit.aligned is not None and hit.result.accepted and hit.result.sample == sample.name
        ]
        mean = np.interp(grid, sample.time, sample.mean[0])
        np.testing.assert_allclose(np.mean(hits, axis=0), mean, atol=1e-6 * np.abs(mean).max())


def test_a_person_s_word_and_other_settings_hold(path, campaign):
    first = next(hit.result for hit in campaign.hits if hit.result.accepted)
    changes = {"pulse_factor": 1.5}
    by_hand = ByHand(reject=[str(first.record)])
    (after,) = analyze(Run(path), changes, by_hand, keep_traces=True).campaigns
    assert [hit.result.record for hit in campaign.hits if hit.result.accepted] == [
        first.record,
        *(hit.result.record for hit in after.hits if hit.result.accepted),
    ]
    assert after.samples[-1].contact_time == pytest.approx(
        1.5 * after.samples[-1].half_amplitude_width
    )


def test_a_simulated_hit_among_measured_ones_is_told(tmp_path):
    rig = VirtualRig(PAPER_SETUP, VirtualRigSettings(seed=11))
    measured = Origin(MEASURED, "digitizer 7")
    blocks = [rig.strike(label).split(10_000, 0)[0] for label in (LABELS[0], *LABELS[4:6])]
    blocks[1:] = [replace(block, origin=measured) for block in blocks[1:]]
    hits = [import_block(block) for block in blocks]
    write_imported(tmp_path / "mixed.mcap", PAPER_SETUP, hits)
    (found,) = analyze(Run(tmp_path / "mixed.mcap")).campaigns
    results = found.results
    assert [hit.origin.kind for hit in results.hits] == ["simulated", "measured", "measured"]
    assert results.origin.kind == "mixed"
    (table,) = tabulate_accepted(results)
    (column,) = [column for column in table.columns if column.header == "Origin"]
    assert column.cells[1] == "measured (digitizer 7)"
    assert column.cells[0].startswith("simulated (virtual rig")
