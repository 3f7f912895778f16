"""The same campaign on three rigs: virtual, devices on sockets and terminals, a recorded file.

`pytest -s` prints their results beside each other.
"""

import json
import math
from collections import Counter

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from impact_rig.configuration.rig_file import read_template

from .processes import COMMAND_LINE, Bench, TalkingProcess

SAMPLES = ("steel small", "aluminium large")
IMPACTS = 4
SEED = 7
QUANTITIES = {
    "contact_time": ("s", 1e6, "τp [µs]"),
    "stiffness": ("n_per_m", 1e-6, "k [MN/m]"),
    "damping_coefficient": ("n_s_per_m", 1.0, "c [N s/m]"),
}
CYCLES = 5
HITS_BETWEEN = 30
"""Enough for the cycles: one to three hits lie between two of them."""
REASONS = {
    "scpi": r"paused: the accelerometer's device is lost: .*127\.0\.0\.1",
    "relay": r"paused: the hammer's device is lost: .*relay",
}


class Rig:
    """The nodes of a rig, each a process, which record into a folder."""

    def __init__(self, folder, environment, *options) -> None:
        self.folder = folder
        self._environment = environment
        self._process = TalkingProcess(
            COMMAND_LINE, "up", "--output", folder, "--no-visualizer", "--stop-with-input",
            "--set", "hammer.swing_time=0.02", "--set", "hammer.reconnect_period=0.1",
            "--set", "accelerometer.reconnect_period=0.1", *options, environment=environment,
        )  # fmt: skip

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()

    def stop(self):
        """Let the recording be closed."""
        self._process.stop()

    def start_campaign(self, *options, output=None):
        return TalkingProcess(
            COMMAND_LINE, "campaign", "--output", output or self.folder, *options,
            environment=self._environment,
        )  # fmt: skip

    def start_common_campaign(self):
        """Start the campaign that all rigs run."""
        return self.start_campaign("--samples", *SAMPLES, "--impacts", IMPACTS)


def finish(campaign, folder):
    """Wait for a campaign to end well; return its results."""
    assert campaign.wait() == 0, campaign.output
    return json.loads((folder / "results.json").read_text("utf-8"))


@pytest.fixture(scope="module")
def virtual(make_environment, tmp_path_factory):
    """Return the folder of the campaign on the virtual rig, and its results."""
    folder = tmp_path_factory.mktemp("virtual")
    (folder / "rig.toml").write_text(read_template(), "utf-8")
    with (
        Rig(folder, make_environment(), "--rig-file", folder / "rig.toml", "--seed", SEED) as rig,
        rig.start_common_campaign() as campaign,
    ):
        results = finish(campaign, folder)
    return folder, results


@pytest.fixture(scope="module")
def by_recording(virtual, make_environment, tmp_path_factory):
    """Return the results of the campaign whose hits come from the recording of the virtual rig."""
    folder = tmp_path_factory.mktemp("recording")
    table = f'\n[source]\ndriver = "recording"\nfile = "{virtual[0] / "session.mcap"}"\n'
    (folder / "rig.toml").write_text(read_template() + table, "utf-8")
    with (
        Rig(folder, make_environment(), "--rig-file", folder / "rig.toml") as rig,
        rig.start_common_campaign() as campaign,
    ):
        return finish(campaign, folder)


@pytest.fixture(scope="module")
def device_rig(make_environment, tmp_path_factory):
    """Return a rig with relay and digitizer on a bench, and the bench."""
    folder = tmp_path_factory.mktemp("devices")
    environment = make_environment()
    with (
        Bench(folder / "bench.toml", "--seed", SEED, environment=environment) as bench,
        Rig(folder, environment, "--rig-file", folder / "bench.toml") as rig,
    ):
        yield rig, bench


@pytest.fixture(scope="module")
def by_devices(device_rig):
    """Return the results of the campaign by devices, for which a person mounts the samples."""
    rig, bench = device_rig
    with rig.start_common_campaign() as campaign:
        place = 0
        for sample in SAMPLES:
            place = campaign.wait_for(f"Mount {sample} and press Enter", place)
            bench.do(f"mount {sample}")
            campaign.tell("")
        return finish(campaign, rig.folder)


def list_figures(results):
    """Return value and expanded uncertainty by sample and quantity."""
    return {
        (sample["name"], name): (
            sample[f"{name}_{unit}"],
            sample[f"{name}_expanded_{unit}"],
        )
        for sample in results["samples"]
        for name, (unit, _, _) in QUANTITIES.items()
    }


def test_hits_of_a_recorded_file_are_those_that_were_recorded_bit_by_bit(virtual, by_recording):
    expected = virtual[1]
    assert len(expected["hits"]) == len(SAMPLES) * IMPACTS
    # Which faults were injected is what the virtual rig alone can say.
    for results in (expected, by_recording):
        for hit in results["hits"]:
            del hit["injected_faults"]
    assert by_recording["hits"] == expected["hits"]
    assert by_recording["samples"] == expected["samples"]


def test_results_of_devices_agree_with_those_of_the_virtual_rig(virtual, by_devices, by_recording):
    rigs = [list_figures(each) for each in (virtual[1], by_devices, by_recording)]
    print(f"\n{'':28}{'virtual rig':>18}{'devices':>18}{'recorded file':>18}")
    for sample, name in rigs[0]:
        _, factor, symbol = QUANTITIES[name]
        figures = [rig[sample, name] for rig in rigs]
        texts = [f"{value * factor:.2f} ± {u * factor:.2f}" for value, u in figures]
        print(f"{sample:16}{symbol:12}" + "".join(f"{text:>18}" for text in texts))
        (value, u), (other, other_u), _ = figures
        assert abs(other - value) <= math.hypot(u, other_u), (sample, name)


def test_each_device_may_be_unplugged_again_and_again_and_no_hit_is_lost_or_double(
    device_rig, by_devices, tmp_path
):
    rig, bench = device_rig
    bench.do("mount steel small")
    before, struck, told = count_strikes(bench), len(bench.output), 0
    with rig.start_campaign(
        "--samples", "steel small", "--impacts", HITS_BETWEEN, "--no-ask", output=tmp_path
    ) as campaign:
        for cycle in range(2 * CYCLES):
            device = ("scpi", "relay")[cycle % 2]
            bench.wait_for('"triggered": true', struck)
            bench.do(f"unplug {device}")
            told = campaign.wait_for(REASONS[device], told)
            struck = len(bench.output)
            bench.do(f"plug {device}")
            told = campaign.wait_for("it goes on", told)
        hits = finish(campaign, tmp_path)["hits"]
    accepted = [hit for hit in hits if hit["accepted"]]
    assert [hit["impact"] for hit in accepted] == list(range(1, HITS_BETWEEN + 1))
    # Each is another stroke of the hammer.
    assert len({hit["contact_time_s"] for hit in accepted}) == HITS_BETWEEN
    assert HITS_BETWEEN <= count_strikes(bench) - before <= len(hits)
    records = {hit["record"] for hit in hits}
    assert len(records) == len(hits)
    rig.stop()
    first = len(by_devices["hits"])
    for counts in read_records(rig.folder / "session.mcap").values():
        assert {record for record in counts if record > first} == records
        assert set(counts.values()) == {1}
    print(f"\n{CYCLES} cycles each: {len(hits)} records, {HITS_BETWEEN} hits accepted")


def count_strikes(bench):
    """Return how often the hammer has struck while the digitizer saw it."""
    return bench.output.count('"triggered": true')


def read_records(path):
    """Return how often each record ended, was stored, and was judged, as the recording says."""
    counts = {"/acceleration": Counter(), "/recorder/stored": Counter(), "/impact": Counter()}
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages(list(counts)):
            # Of an arming without a release the recorder says that none of its blocks is missing.
            is_end = getattr(message, "last", True) and getattr(message, "complete", True)
            if is_end and getattr(message, "blocks", 1):
                counts[channel.topic][message.record] += 1
    return counts
