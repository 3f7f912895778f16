"""What is logged can be read back from the file, whole, with its peaks."""

import numpy as np
import pytest

from impact_rig.core.signals.record import HitLabel
from impact_rig.results.campaign import HitResults
from impact_rig.results.hit_traces import HitTraces

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


@pytest.fixture
def record(tmp_path, write_view, read_recording):
    """Return a function that logs things into a file and reads it back."""

    def run(*works):
        path = tmp_path / "view.rrd"
        write_view(path, *works)
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

    view = record(lambda log: log.log_hit(make_hit()))

    policy = rerun.components.AggregationPolicy.MinMax.value
    assert view.find_static("/hits/1", "SeriesLines:aggregation_policy") == [policy]


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


def test_a_verdict_is_shown_and_logged_with_hit_number_and_time_of_day(record):
    accepted = HitResults("steel small", 3, 1, 17, accepted=True, contact_time_s=160e-6)
    rejected = HitResults("steel small", 4, 1, 18, reasons=("weak: too weak",))

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
