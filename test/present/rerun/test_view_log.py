"""What is logged can be read back from the file, whole, with its peaks."""

from dataclasses import replace

import numpy as np

from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.results.campaign import HitResults
from impact_rig.results.traces import HitTraces

RATE = 2.5e6
COUNT = 5000
TIME = np.arange(COUNT) / RATE
STAMP = 1_700_000_000_123_456_789
LARGEST_FILE = 10e6


def make_hit(record=1):
    pulse = 800.0 * np.sin(np.pi * np.clip((TIME - 0.2e-3) / 160e-6, 0.0, 1.0)) ** 2
    values = np.stack([pulse, -2 * pulse], axis=1).astype(np.float32)
    return HitTraces(HitLabel("steel small", record=record), TIME, values)


def read_names(view):
    """Return the names of tabs and views of a blueprint."""
    return {
        name
        for row in view.read_blueprint()
        for kind in ("Container", "View")
        for name in row.get(f"{kind}Blueprint:display_name") or ()
    }


def test_a_hit_is_there_in_full_with_its_peaks_at_any_size(record):
    import rerun

    hit = make_hit()

    view = record(lambda log: log.log_hit(hit))

    moments, values = view.find_traces("/hits/1")
    np.testing.assert_allclose(moments, hit.time, atol=1e-9)
    np.testing.assert_array_equal(values, hit.values)
    assert view.find_static("/hits/1", "record") == [1]
    policy = rerun.components.AggregationPolicy.MinMax.value
    assert view.find_static("/hits/1", "SeriesLines:aggregation_policy") == [policy]


def test_the_last_hit_hides_the_ones_before_it_even_if_it_is_empty(record):
    empty = HitTraces(HitLabel("steel small", record=3), np.empty(0), np.empty((0, 2), "float32"))

    view = record(*(lambda log, i=i: log.log_hit(make_hit(i)) for i in (1, 2)))
    missed = record(lambda log: log.log_hit(make_hit()), lambda log: log.log_hit(empty))

    assert view.find_hidden() == missed.find_hidden() == {"/hits/1"}
    assert view.find_static("/hits/1", "SeriesLines:names") == ["earlier", "earlier"]
    assert view.find_static("/hits/2", "SeriesLines:names") == ["hammer", "sample"]


def test_verdicts_are_shown_logged_and_followed_over_hit_number_and_time_of_day(record):
    hits = [
        HitResults("a", i, 1, i, i != 2, (), 160e-6 + i * 1e-6, 800.0 + i, 900.0 + i)
        for i in (1, 2)
    ]

    view = record(
        *(lambda log, hit=hit: log.log_verdicts([hit], [STAMP + hit.record]) for hit in hits)
    )

    (text,) = view.find_static("/verdict", "TextDocument:text")
    assert "Rejected" in text
    lines = view.read_rows("/log")
    assert [line["TextLog:level"] for line in lines] == [["INFO"], ["WARN"]]
    rows = view.read_rows("/trends/contact_time/1")
    for items in (lines, rows):
        assert [(row["hit"], row["wall_clock"] - STAMP) for row in items] == [(1, 1), (2, 2)]
    accepted, rejected = np.array([row["Scalars:scalars"] for row in rows]).T
    np.testing.assert_allclose(accepted, [161.0, np.nan], rtol=1e-6)
    np.testing.assert_allclose(rejected, [np.nan, 162.0], rtol=1e-6)
    names = view.find_static("/trends/hammer_peak/1", "SeriesPoints:names")
    assert names == ["accepted", "rejected"]
    peaks = [row["Scalars:scalars"][0] for row in view.read_rows("/trends/sample_peak/1")]
    np.testing.assert_allclose(peaks, [901.0, np.nan])


def test_another_campaign_hides_everything_of_the_one_before(record, campaign):
    names = PAPER_SETUP.samples.names

    view = record(
        lambda log: log.log_campaign(campaign),
        lambda log: log.log_setup("paper", names),
        lambda log: log.log_hit(make_hit()),
        lambda log: log.log_verdicts([HitResults("steel small", 1, 1, 1)], [STAMP]),
    )

    # Of what the new campaign has not measured a sentence says so.
    drawn = view.find_plots() - view.find_hidden()
    assert {path for path in drawn if "/sentence/" not in path} == {"/hits/3"}
    assert len(drawn) == 1 + 3 + 4 * len(names)
    (summary,) = view.find_static(r"/samples/steel\ small/summary", "TextDocument:text")
    assert summary == "No hit yet."


def test_a_campaign_is_there_in_full_and_small(record, campaign):
    view = record(lambda log: log.log_campaign(campaign))

    assert view.size < LARGEST_FILE
    _, earlier = view.find_traces("/hits/1")
    _, shown = view.find_traces("/hits/2")
    assert earlier.shape == (COUNT, 2 * 23)
    np.testing.assert_array_equal(shown, campaign.hits[-1].recorded.values)
    np.testing.assert_array_equal(earlier[:, :2], campaign.hits[0].recorded.values)
    assert len(view.read_rows("/log")) - 1 == len(view.read_rows("/trends/contact_time/1")) == 24
    assert view.find_hidden() == {"/hits/1"}
    for traces in campaign.samples:
        entity = f"/samples/{traces.name}/sample/hits/1".replace(" ", r"\ ")
        hits = [hit for hit in campaign.hits if hit.result.sample == traces.name]
        _, overlay = view.find_traces(entity)
        peaks = [np.abs(hit.aligned.traces[1]).max() for hit in hits]
        np.testing.assert_allclose(np.nanmax(np.abs(overlay), axis=0), peaks, rtol=1e-6)


def test_samples_without_a_hit_have_no_place_in_the_view_of_a_file_unless_none_has(
    record, campaign
):
    struck, nothing = (
        replace(campaign.results, samples=campaign.results.samples[:count]) for count in (2, 0)
    )

    view = record(lambda log: log.log_campaign(replace(campaign, results=struck)))
    places = read_names(view)
    empty = record(
        lambda log: log.log_campaign(
            replace(campaign, results=replace(nothing, hits=()), samples=(), hits=())
        )
    )

    assert "hammer of aluminium medium [m/s²]" in places
    assert "hammer of aluminium large [m/s²]" not in places
    assert "hammer of aluminium large [m/s²]" in read_names(empty)
