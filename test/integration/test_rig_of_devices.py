"""A rig of devices on sockets and terminals: the virtual rig's numbers, and every hit once."""

import json
import math
import sys
from collections import Counter
from contextlib import closing

from fakes.rig_bench import RigBench
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from terminal import Terminal

RIG = (sys.executable, "-m", "impact_rig.cli.main")
SAMPLES = ("steel small", "aluminium large")
IMPACTS = 8
"""Enough for both devices: one to three hits lie between one unplugged and the next."""
TRIES = 20
"""How often a person asks to arm the hammer while its device or the other comes back."""
SEED = 7
QUANTITIES = {
    "contact_time": "s",
    "stiffness": "n_per_m",
    "damping_coefficient": "n_s_per_m",
}
REASONS = {
    "scpi": r"paused: .*127\.0\.0\.1",
    "relay": r"paused: .*relay",
}


def test_a_campaign_outlasts_unplugged_devices_and_finds_the_numbers_of_the_virtual_rig(
    environment, tmp_path, strike
):
    with (
        closing(RigBench(tmp_path / "bench.toml", SEED)) as bench,
        Terminal([
            *RIG, "up", "--output", tmp_path, "--no-visualizer",
            "--set", "hammer.swing_time=0.02", "--set", "hammer.lead_time=0.1",
            "--set", "hammer.reconnect_period=0.1",
            "--set", "accelerometer.reconnect_period=0.1",
            # A busy machine may take seconds to compute the first hit.
            "--set", "accelerometer.trigger_timeout=20.0",
            "--set", "campaign.verdict_timeout=30.0",
            "--rig-file", tmp_path / "bench.toml",
        ], environment) as rig,
        Terminal([
            *RIG, "campaign", "--output", tmp_path,
            *(word for name in SAMPLES for word in ("--sample", name)), "--impacts", IMPACTS,
            "--wait", "60 s",
        ], environment) as campaign,
    ):  # fmt: skip
        bench.to_unplug = [getattr(bench, name) for name in REASONS]
        mount(campaign, bench, SAMPLES[0], 0)
        unplug_each(campaign, bench, environment)
        mount(campaign, bench, SAMPLES[1], 0)
        assert campaign.wait() == 0, campaign.text + rig.text
        rig.interrupt()
        strikes = bench.triggered
    results = json.loads((tmp_path / "results.json").read_text("utf-8"))
    check_hits(results["hits"])
    records = {hit["record"] for hit in results["hits"]}
    releases = check_records(tmp_path / "session.mcap", records)
    # Of a digitizer that is unplugged the record may be lost with it.
    assert len(SAMPLES) * IMPACTS <= strikes <= releases, f"{campaign.text}\n{rig.text}"
    check_numbers(results["samples"], strike(SAMPLES, impacts=IMPACTS, seed=SEED).samples)


def mount(campaign, bench, sample, start):
    campaign.wait_for(f"Mount {sample}, and press Enter", start)
    bench.sample = sample
    campaign.write("\n")


def unplug_each(campaign, bench, environment):
    """Unplug each device in turn, with a strike; after each, a person arms the hammer again."""
    told = 0
    for name, reason in REASONS.items():
        told = campaign.wait_for(reason, told)
        getattr(bench, name).plug()
        for _ in range(TRIES):
            with Terminal([*RIG, "hammer", "arm"], environment) as person:
                if person.wait() == 0:
                    break
        told = campaign.wait_for("the campaign goes on", told)


def check_hits(hits):
    """Require each impact once, each by another stroke of the hammer."""
    accepted = [hit for hit in hits if hit["accepted"]]
    wanted = [(sample, impact) for sample in SAMPLES for impact in range(1, IMPACTS + 1)]
    assert [(hit["sample"], hit["impact"]) for hit in accepted] == wanted
    assert len({hit["contact_time_s"] for hit in accepted}) == len(wanted)
    assert len(hits) == len({hit["record"] for hit in hits})


def check_records(path, records):
    """Require that each record ended once, was stored, and was judged once; count releases."""
    names = "/acceleration", "/recorder/stored", "/impact", "/release"
    counts = {name: Counter() for name in names}
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages(list(counts)):
            if getattr(message, "last", True):
                counts[channel.topic][message.record] += 1
    releases = counts.pop("/release")
    assert counts.pop("/recorder/stored").keys() == records  # said again, for who missed it
    for found in counts.values():
        assert found == dict.fromkeys(records, 1)
    return len(releases)


def check_numbers(samples, virtual):
    """Require what the hits of the virtual rig give by themselves, within the uncertainties."""
    expected = {item.name: item for item in virtual}
    assert {sample["name"] for sample in samples} == set(SAMPLES)
    for sample in samples:
        for name, unit in QUANTITIES.items():
            quantity = getattr(expected[sample["name"]].paper, name)
            found, spread = sample[f"{name}_{unit}"], sample[f"{name}_expanded_{unit}"]
            limit = math.hypot(quantity.expanded, spread)
            assert abs(found - quantity.value) <= limit, (sample["name"], name)
