"""What a campaign costs that is looked at in Rerun, beside bare calls with the same traces."""

import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from bench.campaigns import compress_anew
from bench.measure import Bench, Figure, at_most, compare_times, divide, part
from impact_rig.core.errors import RigError
from impact_rig.core.signals.record import FloatArray
from impact_rig.present.rerun.rerun_sdk import import_rerun
from impact_rig.present.rerun.view_file import write_view
from impact_rig.results.traced_campaign import TracedCampaign

TURNS = 3
VIEWS = 3
"""How often is logged, and how often the command is run [-], our choice: the quartiles lie within
a few percent of each other."""
REPORT_HITS = 30
"""Of three samples, each with a fit of the model and its figures [-], our choice: a report of
twelve samples takes as long as all else here."""
LONGEST_LOGGING = 0.3
"""Of 120 hits with four traces of 5000 points each [s], as asked for."""
LARGEST_FILE = 15.0
"""With these traces and all else that is shown [MB], as asked for."""
LONGEST_VIEW = 2.0
"""From the command to the file [s], as asked for."""
MEGA = 1e6
APPLICATION = "bare_calls"

Trace = tuple[str, FloatArray, FloatArray]
"""Path of an entity, time [s] and values, both of shape (n,)."""


@part("view", "A campaign looked at in Rerun, beside bare calls of it", 11.0)
def measure_view(bench: Bench) -> Iterator[Figure]:
    """Time the logging in this process, and whole commands as a user calls them."""
    # Half a second to load, which only who views a campaign pays.
    from impact_rig.analysis.recording_analysis import analyze_recording

    recording = bench.campaigns.take(1)[0].recording
    yield from _measure_logging(
        bench, analyze_recording(recording, keep_traces=True, with_models=False).campaigns[0]
    )
    views = []
    for number in range(VIEWS):
        bench.report(number, VIEWS)
        views.append(time_command("view", recording, bench.folder / f"{number}.rrd"))
    yield Figure("impact-rig view -o, to the file", views, "s", at_most(LONGEST_VIEW))
    shorter = compress_anew(recording, bench.folder / "part.mcap", "zstd", REPORT_HITS)
    report = time_command("report", shorter, bench.folder / "report.html")
    yield Figure(f"impact-rig report of {REPORT_HITS} hits, to the file", report, "s")


def _measure_logging(bench: Bench, campaign: TracedCampaign) -> Iterator[Figure]:
    """Compare the view of a campaign with bare calls of Rerun."""
    traces = gather_traces([campaign])
    view, bare = bench.folder / "view.rrd", bench.folder / "bare.rrd"
    # Rerun writes in threads of its own: what a person waits for is the end of them all.
    ours, peers = compare_times(
        lambda: write_view(view, campaign),
        lambda: write_bare(bare, traces),
        TURNS,
        clock=time.perf_counter,
    )
    hits = len(campaign.hits)
    points = max((values.size for _, _, values in traces), default=0)
    note = (
        f"{len(traces)} traces of up to {points} points, and all else of the view: means,"
        " figures, tables, layout"
    )
    yield Figure(f"{hits} hits logged into a file", ours, "s", at_most(LONGEST_LOGGING), note)
    note = (
        f"rerun.send_columns of each trace alone, nothing else, {min(peers):.2f} s at best,"
        f" {bare.stat().st_size / MEGA:.0f} MB"
    )
    yield Figure("time over that of bare calls", divide(ours, peers), note=note)
    yield Figure("the file", view.stat().st_size / MEGA, "MB", at_most(LARGEST_FILE))


def gather_traces(campaigns: Sequence[TracedCampaign]) -> list[Trace]:
    """Return all traces of all hits: both channels as recorded, and those that are aligned."""
    found: list[Trace] = []
    for hit in (hit for campaign in campaigns for hit in campaign.hits):
        name = f"hit_{hit.result.record}"
        recorded, aligned = hit.recorded, hit.aligned
        for channel, values in enumerate(recorded.values.T):
            found.append((f"{name}/recorded_{channel}", recorded.time, values))
        if aligned is not None:
            time_axis = aligned.start_time + (
                np.arange(aligned.traces.shape[1]) / aligned.sampling_rate
            )
            for channel, values in enumerate(aligned.traces):
                found.append((f"{name}/aligned_{channel}", time_axis, values))
    return found


def write_bare(path: Path, traces: Sequence[Trace]) -> None:
    """Write traces into a file as Rerun's documentation has it: an entity each, all at once."""
    sdk = import_rerun()
    stream = sdk.RecordingStream(APPLICATION)
    stream.save(path)
    for entity, moments, values in traces:
        duration = np.rint(moments * 1e9).astype("timedelta64[ns]")
        stream.send_columns(
            entity,
            indexes=[sdk.TimeColumn("hit_time", duration=duration)],
            columns=sdk.Scalars.columns(scalars=values),
        )
    stream.flush()
    stream.disconnect()


def time_command(name: str, recording: Path, output: Path) -> float:
    """Return how long a command takes from its start to its end, its file being there [s].

    Raises
    ------
    RigError
        If it writes none.
    """
    words = ["-m", "impact_rig.cli.main", name, str(recording), "-o", str(output)]
    started = time.perf_counter()
    process = subprocess.run([sys.executable, *words], capture_output=True, text=True, check=False)
    taken = time.perf_counter() - started
    if process.returncode or not output.exists():
        reason = process.stderr.strip().splitlines()[-1:] or ["it says nothing"]
        raise RigError(f"impact-rig {name} has written no file: {reason[0]}")
    return taken
