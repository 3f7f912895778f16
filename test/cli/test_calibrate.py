"""`impact-rig calibrate`: sensors whose true sensitivity is known, recorded and live."""

import signal
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from fakes.scpi_digitizer import ScpiDigitizer

from impact_rig.configuration.rig_file import read_rig_file
from impact_rig.core.given.records import UNSTATED, Block, ChannelBlock, HitLabel
from impact_rig.core.given.sensors import Sensor
from impact_rig.core.given.setup import PAPER_SETUP, Sample, SampleSet
from impact_rig.devices.virtual.rig import VirtualHit, VirtualRig, VirtualRigSettings
from impact_rig.recordings.messages import MessageEncoder
from impact_rig.recordings.records import OfferedQos
from impact_rig.recordings.writer import RecordingWriter

from .conftest import finish, start_command

G = 9.80665
DAY = "2023-11-14"
STAMP = 1_700_000_000_000_000_000
RATE = 2.5e6
RIG = """\
# rig of the test bench
[hammer]
mass = "100 g"
impact_speed = "30 cm/s"
[[sample]]
name = "block"
mass = "197 g"
[source]
driver = "scpi"
address = "{address}"
sampling_rate = "2.5 MHz"
trigger_level = "5 g"
[source.hammer]
channel = 1
{hammer}
[source.specimen]
channel = 2
sensitivity = "5 mV/g"   # as bought
calibration_date = 2020-01-01
"""
ACCELERATION = 'sensitivity = "5 mV/g"'
FORCE = 'quantity = "force"\nsensitivity = "2.25 mV/N"'

BLOCK = SampleSet((Sample("block", 0.15),), "")


@pytest.fixture(autouse=True)
def zone(monkeypatch):
    """Let the day be that of universal time."""
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def write_rig(folder, hammer=ACCELERATION, address="127.0.0.1:1"):
    path = folder / "rig.toml"
    path.write_text(RIG.format(hammer=hammer, address=address))
    return path


def make_pulses(number, ratio):
    """Return a versed-sine in both channels [m/s^2], with noise of 0.1 % of 1000 m/s^2."""
    rng = np.random.default_rng(number)
    time = np.arange(5000) / RATE - 0.4e-3
    inside = (time >= 0) & (time <= 200e-6)
    pulse = np.where(inside, np.sin(np.pi * time / 200e-6) ** 2, 0.0)
    height = rng.uniform(500.0, 900.0)
    return tuple(scale * height * pulse + rng.normal(0.0, 1.0, 5000) for scale in (1.0, ratio))


def write(path, setup, blocks):
    """Write a recording of a set-up and blocks, a second after each other."""
    encoder = MessageEncoder()
    with RecordingWriter(path) as writer:
        setups = writer.add_channel("/setup", encoder.setup_definition, (OfferedQos(),))
        channel = writer.add_channel("/acceleration", encoder.block_definition, (OfferedQos(),))
        writer.add_message(setups, encoder.encode_setup(setup, STAMP), STAMP, STAMP)
        for number, block in enumerate(blocks, start=1):
            stamp = STAMP + number * 1_000_000_000
            data = encoder.encode_block(replace(block, stamp=stamp))
            writer.add_message(channel, data, stamp, stamp)
    return path


def record(path, ratio, *, sensors=(), hits=8):
    """Record hits whose specimen trace is `ratio` times the hammer's."""
    blocks = []
    for number in range(1, hits + 1):
        channels = [ChannelBlock(trace, 1.0, 0.0, 2000.0) for trace in make_pulses(number, ratio)]
        blocks.append(Block(0, RATE, *channels, HitLabel("block", number, number), last=True))
    return write(path, replace(PAPER_SETUP, sensors=sensors, samples=BLOCK), blocks)


def read_sensitivity(output):
    """Return the sensitivity of the lines for the rig file [mV per unit]."""
    return float(output.partition('sensitivity = "')[2].split()[0])


@pytest.mark.parametrize(("ratio", "is_asked"), [(1.029, False), (1.031, True), (0.969, True)])
def test_the_lines_for_the_rig_file_have_the_ratio_and_a_large_one_is_asked_about(
    run, tmp_path, ratio, is_asked
):
    path = write_rig(tmp_path)
    recording = record(tmp_path / "hits.mcap", ratio=ratio)
    outcome = run("calibrate", path, "--sensor", "specimen",
                  "--reference-uncertainty", "0.5 %", "--recording", recording)  # fmt: skip
    assert outcome.exit_code == 0
    assert outcome.stdout.startswith("specimen sensor: ")
    question = "is the mount tight, is it the specimen sensor that changed?"
    assert (question in outcome.stderr) is is_asked
    assert ("rig file only when that is settled" in outcome.stdout) is is_asked
    assert "the recording states no sensitivity" in outcome.stderr
    sheet = outcome.stdout[outcome.stdout.index("[source.specimen]") :]
    old = path.read_text().partition("[source.specimen]")[0]
    path.write_text(old + sheet + "channel = 2\n")
    _, sensor = read_rig_file(path).setup.sensors
    assert sensor.sensitivity == pytest.approx(5e-3 * ratio, rel=1e-3)
    assert sensor.sensitivity_uncertainty == pytest.approx(5e-3, rel=0.2)
    assert sensor.calibration_date == DAY


def test_a_body_of_known_mass_gives_the_force_sensors_sensitivity(run, tmp_path):
    # Force as recorded is 0.1 kg times the hammer's trace; the body of 0.2 kg is accelerated by
    # 0.52 of that trace: true is 0.104 kg times it, so the sensor gives 4 % too little.
    path = write_rig(tmp_path, FORCE)
    used = Sensor("hammer", "force", "N", 2e-3)
    recording = record(tmp_path / "hits.mcap", ratio=0.52, sensors=(used,))
    outcome = run("calibrate", path, "--known-mass", "200 g", "--mass-uncertainty", "0.1 g",
                  "--reference-uncertainty", "0.5%", "--recording", recording)  # fmt: skip
    assert read_sensitivity(outcome.stdout) == pytest.approx(2.0 / 1.04, rel=1e-3)
    said = "warning: the hits were measured with 2 mV per N, and the rig file says 2.25"
    assert said in outcome.stderr
    for source in ("known mass", "sensitivity of the reference", "scatter of the hits"):
        assert source in outcome.stdout
    assert "mass of the hammer" not in outcome.stdout


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "back to back, name the sensor under test with --sensor"),
        (("--sensor", "hammer", "--mass-uncertainty", "1 g"), "for --known-mass"),
        (("--known-mass", "1 kg", "--sample", "x"), "--sample is for --recording"),
        (("--known-mass", "1 s"), "which is no kg"),
    ],
)
def test_what_cannot_be_meant_is_refused(run, tmp_path, words, told):
    outcome = run("calibrate", write_rig(tmp_path), *words)
    assert outcome.exit_code == 2
    assert told in outcome.stderr


def test_a_sensor_without_a_sensitivity_is_refused(run, tmp_path):
    outcome = run("calibrate", write_rig(tmp_path, 'unit = "g"'), "--known-mass", "1 kg")
    assert outcome.exit_code == 2
    assert "[source.hammer] has no sensitivity" in outcome.stderr


class Striker:
    """Hits of both sensors alike, as long as the digitizer waits for any.

    Its sensors give 5 and 5.2 mV/g.

    Parameters
    ----------
    strikes : int
        After so many, the digitizer is unplugged.
    """

    def __init__(self, strikes=1_000_000):
        self._left = strikes
        self.digitizer = ScpiDigitizer(0.005 / G, 0.0052 / G)
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._strike)

    def __enter__(self):
        self.digitizer.plug()
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._is_over.set()
        self._thread.join()
        self.digitizer.unplug()

    def _strike(self):
        number = 0
        while not self._is_over.wait(0.02):
            number += 1
            hammer, specimen = (
                ChannelBlock(np.round(8 * trace).astype(np.int32), 0.125, 0.0, 2000.0)
                for trace in make_pulses(number, 1.0)
            )
            model = VirtualRig(PAPER_SETUP, VirtualRigSettings()).strike(
                HitLabel("steel small")
            ).model  # fmt: skip
            label = HitLabel("block", number)
            hit = VirtualHit(label, (), model, hammer, specimen, RATE, UNSTATED)
            # A hit that is not waited for does not count.
            self._left -= self.digitizer.feed(hit)
            if not self._left:
                self.digitizer.unplug()
                return


def test_a_device_that_is_lost_takes_no_hit_with_it(run, tmp_path):
    with Striker(strikes=5) as striker:
        path = write_rig(tmp_path, address=striker.digitizer.address)
        outcome = run("calibrate", path, "--sensor", "specimen", "--hits", 9)
        assert outcome.exit_code == 0, outcome.stderr
        assert read_sensitivity(outcome.stdout) == pytest.approx(5.2, rel=1e-3)
        assert "hits before that are kept" in outcome.stderr
        outcome = run("calibrate", path, "--sensor", "specimen")
        assert (outcome.exit_code, striker.digitizer.address in outcome.stderr) == (2, True)


def test_ctrl_c_keeps_the_hits_that_were_struck(tmp_path):
    with Striker() as striker:
        path = write_rig(tmp_path, address=striker.digitizer.address)
        words = ("--sensor", "specimen", "--hits", 100_000)
        process = start_command("calibrate", path, *words)
        try:
            while not process.stderr.readline().startswith("4 of "):
                assert process.poll() is None
            process.send_signal(signal.SIGINT)
            code, output, errors = finish(process)
        finally:
            process.kill()
    assert code == 0, errors
    assert read_sensitivity(output) == pytest.approx(5.2, rel=1e-3)
