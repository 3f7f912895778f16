"""What is logged can be read back from the file, whole, with its peaks."""

import time

import numpy as np
import pytest

from impact_rig.core.signals.record import HitLabel
from impact_rig.results.hit_traces import HitTraces
from impact_rig.visualization.destinations import open_destinations
from impact_rig.visualization.log import ComparisonTraces
from impact_rig.visualization.text import EstimateRow, EstimateTable, Verdict

RATE = 2.5e6
COUNT = 5000
TIME = np.arange(COUNT) / RATE - 0.2e-3
STAMP = 1_700_000_000_123_456_789


def versed_sine(duration, peak):
    phase = np.clip(TIME / duration, 0.0, 1.0)
    return peak * np.sin(np.pi * phase) ** 2


def make_hit(record=1, peak=800.0):
    values = np.stack([versed_sine(160e-6, peak), -versed_sine(160e-6, 2 * peak)], axis=1)
    return HitTraces(
        HitLabel("steel small", record=record), TIME - TIME[0], values.astype(np.float32)
    )


def make_comparison(sample="steel small", model="driven", contact_time=160e-6, mse=0.5):
    hammer = versed_sine(contact_time, 1.0)
    return ComparisonTraces(
        sample=sample,
        model=model,
        time=TIME,
        hammer_measured=hammer,
        hammer_model=0.9 * hammer,
        specimen_measured=-hammer,
        specimen_model=-0.8 * hammer,
        contact_time=contact_time,
        mse_hammer_percent=0.0001,
        mse_sample_percent=mse,
    )


@pytest.fixture
def record(tmp_path, read_recording):
    """Return a function that logs things into a file and reads it back."""

    def run(*works):
        path = tmp_path / "view.rrd"
        notices = []
        (destination,) = open_destinations(output=str(path), notify=notices.append)
        for work in works:
            destination.put(work)
        destination.close()
        assert notices == []
        assert destination.dropped == 0
        return read_recording(path)

    return run


def test_a_hit_is_there_in_full_with_its_peaks(record):
    hit = make_hit()

    view = record(lambda log: log.log_hit(hit))

    moments, values = view.find_traces("/hits/1")
    assert values.shape == (COUNT, 2)
    np.testing.assert_allclose(moments, hit.time, atol=1e-9)
    np.testing.assert_array_equal(values, hit.values)
    assert view.find_static("/hits/1", "SeriesLines:names") == ["hammer", "sample"]
    assert view.find_static("/hits/1", "record") == [1]


def test_peaks_are_kept_when_the_plot_is_small(record):
    import rerun

    view = record(
        lambda log: log.log_hit(make_hit()), lambda log: log.log_comparison(make_comparison())
    )

    policy = rerun.components.AggregationPolicy.MinMax.value
    for entity in ("/hits/1", r"/comparisons/driven/steel\ small/1"):
        assert view.find_static(entity, "SeriesLines:aggregation_policy") == [policy]


def test_the_last_hit_hides_the_ones_before_it(record):
    view = record(*(lambda log, i=i: log.log_hit(make_hit(i)) for i in (1, 2, 3)))

    for entity in ("/hits/1", "/hits/2"):
        assert view.find_static(entity, "SeriesLines:visible_series") == [False, False]
        assert view.find_static(entity, "SeriesLines:names") == ["earlier", "earlier"]
    assert view.find_static("/hits/3", "SeriesLines:names") == ["hammer", "sample"]
    with pytest.raises(AssertionError, match="visible_series"):
        view.find_static("/hits/3", "SeriesLines:visible_series")


def test_a_missed_trigger_leaves_no_trace_of_the_hit_before(record):
    empty = HitTraces(HitLabel("steel small", record=2), np.empty(0), np.empty((0, 2), "float32"))

    view = record(lambda log: log.log_hit(make_hit()), lambda log: log.log_hit(empty))

    assert view.find_static("/hits/1", "SeriesLines:visible_series") == [False, False]


def test_a_comparison_has_four_traces_and_marks_the_contact(record):
    comparison = make_comparison(mse=1.234)

    view = record(lambda log: log.log_comparison(comparison))

    entity = r"/comparisons/driven/steel\ small/1"
    moments, values = view.find_traces(entity)
    assert values.shape == (COUNT, 4)
    np.testing.assert_allclose(moments, TIME, atol=1e-9)
    np.testing.assert_allclose(np.abs(values).max(axis=0), [1.0, 0.9, 1.0, 0.8], rtol=1e-6)
    names = view.find_static(entity, "SeriesLines:names")
    assert names[1] == "hammer, model (MSE < 0.001 %)"
    assert names[3] == "sample, model (MSE 1.234 %)"
    moments, values = view.find_traces(f"{entity}/contact")
    np.testing.assert_allclose(moments, [0.0, 160e-6])
    np.testing.assert_array_equal(values, [[0.0], [0.0]])


def test_a_later_comparison_takes_the_place_of_the_earlier_of_the_same_sample_only(record):
    view = record(
        lambda log: log.log_comparison(make_comparison("a/b *c*")),
        lambda log: log.log_comparison(make_comparison("steel small")),
        lambda log: log.log_comparison(make_comparison("steel small", "printed")),
        lambda log: log.log_comparison(make_comparison("steel small")),
    )

    hidden = {
        chunk.entity_path
        for chunk in view.chunks
        if any("visible_series" in name for name in chunk.to_record_batch().schema.names)
    }
    first = r"/comparisons/driven/steel\ small/1"
    assert hidden == {first, f"{first}/contact"}
    assert r"/comparisons/driven/a\/b\ \*c\*/1" in view.entities


def test_a_verdict_is_shown_and_logged_with_hit_number_and_time_of_day(record):
    label = HitLabel("steel small", record=17, impact=3)
    accepted = Verdict(label, True, (), 160e-6)
    rejected = Verdict(HitLabel("steel small", record=18, impact=4), False, ("weak: too weak",))

    view = record(
        lambda log: log.log_verdict(accepted, STAMP),
        lambda log: log.log_verdict(rejected, STAMP + 1),
    )

    (text,) = view.find_static("/verdict", "TextDocument:text")
    assert "Rejected" in text
    lines = view.read_log()
    assert [line["hit"] for line in lines] == [17, 18]
    assert [line["TextLog:level"] for line in lines] == [["INFO"], ["WARN"]]
    assert [line["wall_clock"] for line in lines] == [STAMP, STAMP + 1]


def test_the_table_is_markdown(record):
    view = record(lambda log: log.log_estimates(EstimateTable((EstimateRow("steel", 1, 0),))))

    assert view.find_static("/results", "TextDocument:media_type") == ["text/markdown"]
    (text,) = view.find_static("/results", "TextDocument:text")
    assert text.startswith("| Sample |")


def test_the_blueprint_is_stored_with_a_plot_per_sample_and_model(record):
    view = record(lambda log: log.log_setup("paper", ("aluminium small", "steel large")))

    rows = view.read_blueprint()
    origins = [
        row["ViewBlueprint:space_origin"][0] for row in rows if "ViewBlueprint:space_origin" in row
    ]
    names = {
        row["ContainerBlueprint:display_name"][0]
        for row in rows
        if row.get("ContainerBlueprint:display_name")
    }
    assert names >= {"Last hit", "Samples", "Samples, model as printed", "Results"}
    assert sorted(origins) == [
        r"/comparisons/driven/aluminium\ small",
        r"/comparisons/driven/steel\ large",
        r"/comparisons/printed/aluminium\ small",
        r"/comparisons/printed/steel\ large",
        "/hits",
        "/log",
        "/results",
        "/verdict",
    ]
    assert view.find_static("/__properties", "RecordingInfo:name") == ["paper"]


def test_a_campaign_is_logged_in_well_under_a_second(record):
    works = [lambda log, i=i: log.log_hit(make_hit(i)) for i in range(120)]
    works += [lambda log, i=i: log.log_comparison(make_comparison(f"s{i}")) for i in range(12)]

    start = time.process_time()
    view = record(*works)

    # 0.1 s here; generous, since machines that run tests are slow and busy.
    assert time.process_time() - start < 5.0
    assert len(view.entities) > 120
