"""`impact-rig export --for`: contacts of the virtual rig, whose law is known, for simulators."""

import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import pytest

from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import VirtualRigSettings
from impact_rig.results.results_file import write_results
from impact_rig.simulators.check import find_obstacle
from impact_rig.simulators.parameters import ENGINES

SAMPLE = "steel small"


@pytest.fixture(scope="module")
def recorded(record, tmp_path_factory):
    """Return a campaign of one sample of steel: 158 us, n = 3/2, e = 0.95."""
    path = tmp_path_factory.mktemp("contact") / "session.mcap"
    return record(path, VirtualRigSettings(plant=Plant.CONTACT, seed=7), (SAMPLE,), 3)


def test_a_recording_and_its_results_give_the_same_files(run, recorded, tmp_path):
    write_results(tmp_path / "results.json", recorded.results)
    for folder, source in (("a", recorded.path), ("b", tmp_path / "results.json")):
        done = run("export", source, "--for", "all", "-o", tmp_path / folder)
        assert done.exit_code == 0
        assert len(done.stdout.splitlines()) == len(ENGINES)
    names = ["adams.adm", "chrono.py", "drake.sdf", "mujoco.xml", "pybullet.py", "sdf.sdf"]
    for folder in ("a", "b"):
        assert sorted(path.name for path in (tmp_path / folder).iterdir()) == names
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_what_is_exported_is_what_the_virtual_rig_struck_with(run, recorded, tmp_path):
    output = tmp_path / "steel.sdf"
    assert run("export", recorded.path, "--for", "drake", "-o", output).exit_code == 0
    assert "Origin of the hits: simulated (virtual rig, plant contact)." in output.read_text()
    properties = {
        item.tag.partition("}")[2]: float(item.text or "nan")
        for item in ET.parse(output).getroot().iter()
        if item.tag.startswith("{drake.mit.edu}") and (item.text or "").strip()
    }
    # e = 0.95 at 81.9 mm/s: alpha v = 0.0789 by the energy of the law.
    assert properties["hunt_crossley_dissipation"] == pytest.approx(0.0789 / 0.0819, rel=0.05)
    assert properties["point_contact_stiffness"] == pytest.approx(2.0 * 1.471e7, rel=0.02)


def test_other_masses_and_speeds(run, recorded, tmp_path):
    words = ("--sample", SAMPLE, "--for", "adams", "--hammer", "1 kg", "-o", tmp_path / "x.adm")
    assert run("export", recorded.path, *words).exit_code == 0
    assert "Bodies: 1000.00 g and 59.32 g" in (tmp_path / "x.adm").read_text("utf-8")
    words = ("--for", "adams", "--speed", "1 m/s", "-o", tmp_path / "y.adm")
    done = run("export", recorded.path, *words)
    assert done.exit_code != 0
    assert "1000 mm/s is outside what was measured on 'steel small'" in done.stderr
    assert not (tmp_path / "y.adm").exists()


def test_speeds_that_were_measured_make_a_range(run, record, recorded, tmp_path):
    setup = replace(PAPER_SETUP, impact_speed=0.16)
    settings = VirtualRigSettings(plant=Plant.CONTACT, seed=7)
    fast = record(tmp_path / "fast.mcap", settings, (SAMPLE,), 3, setup=setup)
    paths = (fast.path, recorded.path)
    words = ("--for", "drake", "--speed", "12 cm/s", "-o", tmp_path / "x.yaml")
    assert run("export", *paths, *words).exit_code == 0
    text = " ".join((tmp_path / "x.yaml").read_text("utf-8").replace("#", "").split())
    assert re.search(r"Simulated at 8[12]\.\d\d to 1[56]\d\.\d\d mm/s", text)
    spread = re.search(r"point_contact_stiffness = .* N/m, (\S+) to (\S+) over the measured", text)
    # A Hertz contact's stiffness as a spring goes as v^(2/5).
    assert spread
    slow, fast_one = map(float, spread.groups())
    assert fast_one / slow == pytest.approx((160.0 / 81.9) ** 0.4, rel=0.02)


def test_the_simulators_that_are_there_strike(run, recorded, tmp_path):
    there = [name for name, engine in ENGINES.items() if not find_obstacle(engine)]
    if not there:
        pytest.skip("no simulator is installed: pip install mujoco")
    picture = tmp_path / "pulse.svg"
    words = ("--for", "all", "-o", tmp_path / "out", "--check", "--figure", picture)
    done = run("export", recorded.path, *words)
    assert done.exit_code == 0
    assert "steel small in simulators: 100.0 g meet 59.3 g" in done.stdout
    text = picture.read_text("utf-8")
    ET.fromstring(text)
    for name in there:
        title = ENGINES[name].title
        assert f"{title}: duration and restitution are within 2 %" in done.stdout
        assert f"{title}, steps of 0.1 µs" in text
    assert "measured" in text
    assert "remark: --check does not run in Chrono" in done.stderr


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--for", "mujoco", "-o", "x.sdf"), "x.sdf is no file of mujoco, which has .xml"),
        (("--for", "sdf", "-o", "x.sdf", "--check"), "--check does not run in SDFormat"),
        (("--for", "sdf", "-o", "x.sdf", "--figure", "x.bmp"), "x.bmp is no picture"),
        (("--for", "sdf", "-o", "x.sdf", "--sample", "gold"), "no result of sample 'gold'"),
        (("--for", "sdf", "-o", "x.sdf", "--filtered"), "--filtered is not for simulators"),
        (("-o", "x.csv", "--check"), "--check needs --for"),
        (("--for", "sdf", "-o", "x.sdf", "--samples", "a", "--samples", "b"), "for one sample"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(
    run, recorded, tmp_path, monkeypatch, words, sentence
):
    monkeypatch.chdir(tmp_path)
    done = run("export", recorded.path, *words)
    assert done.exit_code != 0
    assert sentence in " ".join(done.stderr.split())
    assert list(tmp_path.iterdir()) == []
