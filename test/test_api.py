"""The library: what a person types is what it does."""

import doctest
import pickle
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pint
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import impact_rig as ir
from impact_rig import api
from impact_rig.analysis import hits as analysis_hits
from impact_rig.configuration.rig_file import load_rig_file
from impact_rig.core.given.quantity import Description
from impact_rig.devices.source_table import make_source
from impact_rig.files.formats.registry import write_measurement
from impact_rig.files.importing import write_imported
from impact_rig.files.measurement import MeasuredChannel, Measurement
from impact_rig.present import printed, printed_results
from impact_rig.present.printed import Number
from impact_rig.testing import score

mpl.use("Agg")
README = Path(__file__).resolve().parent.parent / "README.md"
CONTROL, STEEL = "aluminium large", "steel small"
CHANNELS = "hammer", "specimen"


@pytest.fixture(scope="module")
def run():
    return ir.VirtualRig(seed=7).run([STEEL, CONTROL], 4)


@pytest.fixture(scope="module")
def results(run):
    return run.analyze()


@pytest.mark.parametrize(
    "module", [api, analysis_hits, printed, printed_results], ids=lambda module: module.__name__
)
def test_every_example_of_the_public_interface_is_true(module):
    found = doctest.testmod(module, optionflags=doctest.IGNORE_EXCEPTION_DETAIL | doctest.ELLIPSIS)
    assert found.attempted > 1, module
    assert not found.failed


MISTYPED = """
import impact_rig as ir

run = ir.VirtualRig(plant="contact", seed=7).run(["steel small"], 3)
steel = run.analyze(cutoff="20 kHz", pulse_factor=1.9)["steel small"]
print(steel.contact_time, steel.contact_law.exponent, steel.free_decay.stiffness.budget)
ir.Session({"steel": "56 g"}, hammer_mass="100 g", accelerometer_mass="3 g", cutoff=2e4)
ir.read_files("a.csv", hammer_mass="100 g")

ir.read_files("a.csv", hamer_mass="100 g")
ir.estimate([], rate=1e6, hamer_mass="100 g")
ir.Session({"steel": "56 g"}, acelerometer_mass="3 g")
run.analyze(cut_off="20 kHz")
ir.VirtualRig(plant="moon")
print(steel.contact_tim)
print(steel.contact_law.exponnt)
"""
CHECKERS = {"mypy": ["mypy", "--strict"], "basedpyright": ["basedpyright", "--level", "error"]}


@pytest.mark.timeout(300)  # mypy reads the whole package, and numpy
@pytest.mark.parametrize("checker", CHECKERS)
def test_checkers_of_types_find_a_misspelt_name(checker, tmp_path):
    pytest.importorskip(checker)
    path = tmp_path / "mistyped.py"
    path.write_text(MISTYPED)
    command = [sys.executable, "-m", *CHECKERS[checker], str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    found = {int(line) for line in re.findall(r"mistyped\.py:(\d+)", done.stdout)}
    assert found == set(range(10, 17)), done.stdout


def test_what_is_public_is_listed_once_and_explained():
    assert ir.__all__ == sorted(ir.__all__)
    assert set(ir.__all__) <= set(dir(ir))
    for name in ir.__all__:
        assert getattr(ir, name).__doc__, name
    with pytest.raises(AttributeError, match="nonsense"):
        _ = ir.nonsense


def test_importing_the_package_loads_no_library_and_its_names_load_no_ros():
    code = (
        "import sys, impact_rig as ir; before = ';'.join(sys.modules); ir.open_run;"
        " from impact_rig.testing import score; print(before, ';'.join(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    before, after = (set(text.split(";")) for text in done.stdout.split())
    assert not {"numpy", "scipy", "click", "rich"} & before
    assert "impact_rig.api" in after
    assert not {"rclpy", "impact_rig_msgs", "matplotlib", "pandas", "pytest"} & after


WITHOUT_POSIX = """
import os, signal, sys
import numpy, scipy.io  # which ask the system what it is
sys.modules.update(dict.fromkeys(["fcntl", "resource", "termios", "pwd", "grp"]))
for module, names in (
    (os, "fork fdatasync posix_fadvise statvfs fstatvfs sched_getaffinity killpg setsid"),
    (signal, "setitimer SIGKILL SIGHUP pthread_sigmask"),
):
    for name in names.split():
        delattr(module, name)
import impact_rig as ir
run = ir.VirtualRig(seed=7).run(["steel small"], 2)
run.analyze().save("results.json")
hit = run.hits["steel small"][0]
scipy.io.savemat("hit.mat", {"hammer": hit.hammer})
ir.read_files("hit.mat", rate="2.5 MHz", hammer_unit="m/s^2").analyze()
for path in ("results.json", sys.argv[1]):
    print(list(ir.open_run(path).analyze()))
from impact_rig.cli.start import main
sys.argv.insert(1, "analyze")
main()
"""


def test_files_are_analyzed_on_a_system_without_the_modules_of_posix(recording, tmp_path):
    command = [sys.executable, "-c", WITHOUT_POSIX, recording]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert not done.returncode, done.stderr
    assert done.stdout.startswith("['steel small']\n['steel small', 'aluminium large']\n")
    assert "Contact time, stiffness, damping" in done.stdout


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (
            Number(169.68e-6, 0.06e-6, 0.13e-6, said=Description("s", shown="µs")),
            "169.68 ± 0.13 µs",
        ),
        (Number(22.5432e6, said=Description("N/m", shown="MN/m")), "22.5432 MN/m"),
        (Number(7.861e9, 1e8, 3.3e8, said=Description("N/m^n")), "(7.86 ± 0.33)e9 N/m^n"),
        (Number(-2.5e-5, 1e-6, 2e-6, said=Description("m")), "(-2.50 ± 0.20)e-5 m"),
        (Number(0.0, 0.1, 0.2), "0.00 ± 0.20"),
        (Number(said=Description("s")), "not determined"),
    ],
)
def test_a_number_prints_itself_with_unit_and_uncertainty(number, text):
    assert str(number) == f"{number}" == repr(number) == text
    assert f"{number:>30}" == f"{text:>30}"


def test_hits_are_arrays_with_their_verdict_and_the_virtual_rigs_truth(run):
    (first, *_) = hits = run.hits[STEEL]
    assert [(hit.impact, hit.accepted, hit.reasons) for hit in hits] == [
        (impact, True, ()) for impact in range(1, 5)
    ]
    assert first.hammer.shape == first.specimen.shape == first.time.shape
    assert first.time[1] == pytest.approx(0.4e-6)
    # Momentum is handed over: the hammer's mass times its change of speed, by the contact alone.
    contact = np.abs(first.filtered.time) < 0.5 * first.truth.contact_time
    force = 0.1 * np.abs(first.filtered.traces[0, contact]).max()
    assert force == pytest.approx(first.truth.peak_force, rel=0.01)
    assert first.truth.contact_time == pytest.approx(170e-6, rel=0.01)


def test_a_sample_has_its_quantities_with_budgets_and_the_fields_of_its_estimate(results):
    steel = results[STEEL]
    assert steel.contact_time.value == results.record.samples[1].paper.contact_time.value
    assert sum(line.share for line in steel.stiffness.budget) == pytest.approx(1.0)
    assert "mass of the accelerometer" in str(steel.stiffness.budget)
    assert isinstance(steel.contact_law.duration, Number)
    assert set(steel.numbers) <= set(dir(steel))
    assert set(type(steel).__annotations__) <= set(dir(steel))
    with pytest.raises(AttributeError, match=r"has no 'stifness': it has .*stiffness"):
        _ = steel.stifness


def test_a_ratio_of_results_counts_what_they_share_once(results):
    """Held against a Monte Carlo of equations (4) to (6): k of hammer and sample share masses."""
    random, count = np.random.default_rng(1), 200_000
    setup, steel = results.record.setup, results[STEEL]

    def draw(value, standard):
        return value + standard * random.standard_normal(count)

    def draw_time(found):
        own = sum(item.contribution**2 for item in found.budget if item.kind == "A")
        return found.value + draw(0.0, own**0.5) + shared * (found.standard**2 - own) ** 0.5

    shared = random.standard_normal(count)  # clock, low-pass
    hammer = draw(setup.hammer_mass, setup.hammer_mass_uncertainty)
    carried = draw(setup.samples.accelerometer_mass, setup.samples.accelerometer_mass_uncertainty)
    equivalent = {}
    for name in (CONTROL, STEEL):
        sample = setup.samples.find(name)
        moving = carried + draw(sample.mass, sample.mass_uncertainty)
        mass = hammer * moving / (hammer + moving)
        equivalent[name] = mass * (np.pi / draw_time(results[name].contact_time)) ** 2
    k1 = 2.0 * equivalent[CONTROL]
    k2 = 1.0 / (1.0 / equivalent[STEEL] - 1.0 / k1)
    ratio = results.hammer.stiffness / steel.stiffness
    assert ratio.value == pytest.approx(np.median(k1 / k2), rel=1e-3)
    assert ratio.standard == pytest.approx(np.std(k1 / k2), rel=0.02)
    alone = ratio.value * np.hypot(
        *(item.standard / item.value for item in (results.hammer.stiffness, steel.stiffness))
    )
    assert alone != pytest.approx(ratio.standard, rel=0.03)  # as if they shared nothing
    assert ratio.unit == ""


def test_numbers_go_on_computing(results):
    k, tau = results[STEEL].stiffness, results[STEEL].contact_time
    assert str(k - k) == "0.00000 N/m"
    assert (2 * k + k - 1 * k).standard == pytest.approx(2 * k.standard)
    assert (1 / tau).unit == "1/s"
    assert (k**0.5).standard == pytest.approx(0.5 * k.standard / k.value**0.5)
    assert (-k * tau).unit == "N*s/m"
    first, second = pickle.loads(pickle.dumps((k, tau)))
    assert (first * second).standard == pytest.approx((k * tau).standard)
    with pytest.raises(ir.RigError, match="of different units: N/m and s"):
        k + tau
    with pytest.raises(TypeError):
        k + "1"
    with pytest.raises(ir.RigError, match="does not know which inputs it shares"):
        _ = 2 * results[STEEL].peak_force


def test_results_and_numbers_are_latex(results):
    assert f"{results[STEEL].contact_time:.2fL}" == "170.07 $\\pm$ 0.41 $\\mu$s"
    uneven = Number(0.45, 0.1, 0.3, 0.27, 0.89, said=Description("N s/m"))
    assert f"{uneven:.2fL}" == "0.45$\\,^{+0.44}_{-0.18}$ N s/m"
    head, *rows = (line for line in results.to_latex().splitlines() if "&" in line)
    assert head.startswith("Sample & $\\tau$p [$\\mu$s] & ")
    (row,) = (line for line in rows if line.startswith(STEEL))
    assert f"{results[STEEL].contact_time:L}".removesuffix(" $\\mu$s") in row
    assert not [line for line in rows if line.count("&") != head.count("&")]


def test_results_are_numbers_of_another_library(results):
    pytest.importorskip("uncertainties")
    found = results.to_uncertainties()
    ratio = found["hammer"]["stiffness"] / found[STEEL]["stiffness"]
    wanted = results.hammer.stiffness / results[STEEL].stiffness
    assert (ratio.n, ratio.s) == pytest.approx((wanted.value, wanted.standard))


def test_results_print_the_screens_table_and_go_into_a_notebook(results):
    steel = next(line for line in str(results).splitlines() if line.startswith(STEEL))
    assert str(results[STEEL].contact_time).removesuffix(" µs") in steel
    assert repr(results).startswith("2 samples, 8 hits accepted, 0 rejected")
    for shown in (results, results[STEEL], results[STEEL].stiffness.budget):
        text = shown._repr_html_()
        assert text.count("<tr>") == text.count("</tr>") > 2


def test_a_setting_is_changed_and_a_hit_left_out_by_keyword(run, results):
    changed = run.analyze(cutoff="20 kHz", reject=f"{STEEL}/3")
    assert changed.record.setup.analysis.cutoff_frequency == 20e3
    assert changed[STEEL].impacts_accepted == 3
    assert run.analyze(cutoff=20_000, pulse_factor=1.9)[STEEL].contact_time.value == pytest.approx(
        1.9 / 2.0 * run.analyze(cutoff=20e3)[STEEL].contact_time.value
    )
    comparison = ir.compare(results, changed)
    assert not comparison.changed
    assert str(comparison).startswith("Changes\n")  # both are of the run


def test_a_comparison_says_what_changed(run, results):
    slower = ir.Session({CONTROL: "102.38 g"}, hammer_mass="100 g", control=CONTROL)
    for hit in run.hits[CONTROL]:
        slower.add(hit.hammer, hit.specimen, rate=0.9 * hit.rate, on=CONTROL)
    comparison = ir.compare(results, slower)
    assert (CONTROL, "k [MN/m]") in comparison.changed
    of_one = ir.compare(results[CONTROL], slower.results[CONTROL])
    assert of_one.changed == comparison.changed
    assert repr(comparison).startswith(f"{len(comparison.changed)} of ")
    with pytest.raises(ir.RigError, match="no quantity in common"):
        ir.compare(results, ir.VirtualRig().run(["brass small"], 2).analyze())


SETTINGS = {
    'cutoff is "20 kg", which is no Hz': {"cutoff": "20 kg"},
    "cutoff is True": {"cutoff": True},
    "cutoff is nan: .* finite number": {"cutoff": np.nan},
    "too low for the 3e.06 kHz low-pass": {"cutoff": "3 GHz"},
    "unknown setting 'cut_off': there are 'cutoff', 'pulse_factor'": {"cut_off": 3.0},
    "pulse_factor is '2': it must be a number": {"pulse_factor": "2"},
    "there is no hit 'steel small/9'": {"reject": "steel small/9"},
    "there is no hit 'brass small/1.1'": {"reject": ir.VirtualRig().strike("brass small")},
}


@pytest.mark.parametrize("words", SETTINGS)
def test_what_cannot_be_meant_is_refused_in_a_sentence(run, words):
    with pytest.raises(ir.RigError, match=words):
        run.analyze(**SETTINGS[words])


def test_a_hit_is_named_by_itself_or_by_its_number(run):
    hit = run.hits[CONTROL][1]
    for chosen in (hit, [hit], hit.record, np.int64(hit.record), (f"{CONTROL}/{hit.impact}",)):
        assert run.analyze(reject=chosen)[CONTROL].impacts_rejected == 1


HIT = ir.VirtualRig(seed=7).strike(STEEL)
PINT = pint.UnitRegistry()
pandas = pytest.importorskip("pandas")
MISTAKES = {
    "no file is given": lambda: ir.read_files([]),
    "files is 3: it must be the name of a file": lambda: ir.read_files([3]),
    "path is None: it must be the name of a file": lambda: ir.open_run(None),
    r"README\.md is no MCAP recording": lambda: ir.open_run(README),
    "seed of the virtual rig is -1: it must be a whole number between 0": lambda: ir.VirtualRig(
        seed=-1
    ),
    "seed of the virtual rig is 1.5: it must be a whole number": lambda: ir.VirtualRig(seed=1.5),
    "plant of the virtual rig is 'moon': it must be one of published, ": lambda: ir.VirtualRig(
        plant="moon"
    ),
    "fault_probability of the virtual rig is 'many'": lambda: ir.VirtualRig(faults="many"),
    "the virtual rig has an unknown key 'noize': did you mean 'noise'": lambda: ir.VirtualRig(
        noize=0.1
    ),
    "noise is 1.5: it must lie between 0 and 1": lambda: ir.VirtualRig(noise=1.5),
    "sample 'mine' is 3: give its keys": lambda: ir.VirtualRig(samples={"mine": 3}),
    "sample 'mine' has an unknown key 'weight'": lambda: ir.VirtualRig(
        samples={"mine": {"weight": 3}}
    ),
    "impacts is 2.5: it must be a whole number": lambda: ir.VirtualRig().run(CONTROL, 2.5),
    "impacts is 0: .* 1 or more": lambda: ir.VirtualRig().run(CONTROL, 0),
    "unknown sample 3: there are": lambda: ir.VirtualRig().run(3),
    "'runs/a' is neither a run nor results": lambda: ir.compare("runs/a", "runs/b"),
    "samples is .'steel'.: it must give each": lambda: ir.Session(["steel"]),
    "rig_file gives samples, masses, .* and sensors: give it alone": lambda: ir.Session(
        {"steel": 1}, rig_file="a.toml"
    ),
    "stiffness and a control sample both": lambda: estimate(control=True, hammer_stiffness=2e7),
    "hammer is in V: Session needs its hammer_sensitivity": lambda: estimate(unit="V"),
    "hammer_sensitivity is '3': it must be a voltage per unit": lambda: estimate(
        unit="V", hammer_sensitivity="3"
    ),
    "minimum_peak is a part of full scale, .*: leave it out": lambda: estimate(minimum_peak=0.2),
    "hammer_mass is 3 second, which is no kg": lambda: estimate(hammer_mass=PINT("3 s")),
    "hammer is in kelvin: it must be in m/s": lambda: estimate(PINT.Quantity(HIT.hammer, "K")),
    "hammer is in N by itself: unit is 'g'": lambda: estimate(
        PINT.Quantity(HIT.hammer, "N"), unit="g"
    ),
    "rate is 2.5e.06 Hz: by the times of the array it is 1e.06 Hz": lambda: estimate(
        pandas.Series(HIT.hammer, index=1e-6 * np.arange(HIT.hammer.size))
    ),
    "hammer has times with a gap, .*: all must be 4e-07 s": lambda: estimate(
        pandas.Series(HIT.hammer, index=HIT.time).drop(HIT.time[100])
    ),
    "rate is not given": lambda: estimate(rate=None),
    "hammer_channel is 0: it must be a whole number, 1 or more": lambda: ir.read_files(
        "a.csv", hammer_channel=0
    ),
    "sample is 3: it must be a text": lambda: ir.read_files("a.csv", sample=3),
    "control sample needs both masses": lambda: estimate(control=True, sample_mass=None),
    "rate is 2.5: it must lie between": lambda: estimate(rate=2.5),
    "unit .m. is unknown": lambda: estimate(unit="m"),
    "cutoff_frequency is 1.0 Hz: in a record of 0.002 s it must": lambda: estimate(cutoff="1 Hz"),
    "shorter than record_duration, which is 1e-06 s": lambda: estimate(record_duration="1 us"),
    "hammer_mass is nan": lambda: estimate(hammer_mass=np.nan),
    "hit is 'steel small/1': it must be a hit": lambda: ir.VirtualRig().find_truth(
        "steel small/1"
    ),
    "estimator is 3: it must be a function": lambda: score(3),
    "masked points": lambda: estimate(np.ma.masked_greater(np.arange(50.0), 40.0)),
    "hammer is .*must be an array of real numbers": lambda: estimate(["a"] * 50),
    "of real numbers": lambda: estimate(HIT.hammer + 1j),
    r"rows of shape \(3,\).* 16 points or more": lambda: estimate(np.zeros(3)),
    r"rows of shape \(2,\)": lambda: estimate(np.stack([HIT.hammer, HIT.specimen], axis=1)),
    "no pulse": lambda: estimate(np.zeros(5000)),
    "hammer is nan at point 0": lambda: estimate(np.full(5000, np.nan)),
    r"hammer has \[50, 50\] points, specimen \[50\]": lambda: estimate(
        np.zeros((2, 50)), np.zeros(50)
    ),
}


def estimate(hammer=HIT.hammer, specimen=None, **given):
    known = {"rate": "2.5 MHz", "hammer_mass": "100 g", "sample_mass": "56.32 g"}
    return ir.estimate(hammer, specimen, **{**known, **given})


@pytest.mark.parametrize("words", MISTAKES)
def test_a_mistake_is_named_in_a_sentence(words):
    with pytest.raises(ir.RigError, match=words):
        MISTAKES[words]()


def test_an_unknown_sample_is_the_key_error_that_a_mapping_raises(run, results):
    for mapping in (run.hits, results):
        with pytest.raises(KeyError, match=r"^unknown sample 'steel': there are .*'steel small'"):
            mapping["steel"]
        assert mapping.get("steel") is None
        assert "steel" not in mapping


def test_a_plot_leaves_the_settings_of_matplotlib_as_they_were(results):
    plt.ion()
    before = dict(mpl.rcParams)
    results[STEEL].plot()
    assert dict(mpl.rcParams) == before
    plt.ioff()
    plt.close("all")


def test_a_plot_shows_traces_residuals_and_law(tmp_path):
    results = ir.VirtualRig(seed=7, plant="contact").run([STEEL, CONTROL], 3).analyze()
    figure = results[STEEL].plot()
    labels = {axes.get_ylabel() for axes in figure.axes}
    assert labels == {"a [m/s²]", "residual", "force [N]"}
    figure.savefig(tmp_path / "steel.png")
    model = ir.VirtualRig(seed=7).run([STEEL, CONTROL], 3).analyze()[STEEL]
    residual = model.traces.compute_residual(model.traces.models[0])
    assert residual.shape == model.traces.mean.shape
    assert "residual" in {axes.get_ylabel() for axes in model.plot().axes}


def test_a_row_a_sample_with_the_columns_of_the_export(results):
    frame = results.to_dataframe()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame["name"]) == list(frame.index) == [CONTROL, STEEL]
    assert frame["stiffness_n_per_m"][STEEL] == results[STEEL].stiffness.value
    hits = results.hits_to_dataframe()
    assert list(hits.index) == 4 * [STEEL] + 4 * [CONTROL]
    assert hits["accepted"].all()
    assert hits.loc[STEEL, "contact_time"].mean() == pytest.approx(170e-6, rel=0.01)
    changes = ir.compare(results, results).to_dataframe()
    assert set(changes["En"]) == {0.0}
    scores = score(lambda hit: hit.truth.contact_time, samples=STEEL, impacts=2).to_dataframe()
    assert scores.loc[STEEL, "bias"] == 0.0


def test_traces_are_drawn_into_axes_of_ones_own(results):
    figure, (left, right) = plt.subplots(1, 2)
    assert results[STEEL].plot(ax=right) is figure
    assert not left.lines
    assert len(right.lines) > 2
    assert right.get_xlabel().startswith("time")
    plt.close(figure)


def test_results_alone_open_and_say_that_there_are_no_hits(results, tmp_path):
    path = tmp_path / "results.json"
    results.save(path)
    stored = ir.open_run(path)
    assert str(stored.analyze()) == str(results)
    with pytest.raises(ir.RigError, match="results alone"):
        _ = stored.hits
    with pytest.raises(ir.RigError, match="path is 3: it must be the name of a file"):
        results.save(3)
    results.save(tmp_path / "results.csv")
    assert list(pandas.read_csv(tmp_path / "results.csv")["name"]) == [*results]
    with pytest.raises(ir.RigError, match=r"saved as \.json or \.csv, not as .*results"):
        results.save(tmp_path / "results")
    with pytest.raises(ir.RigError, match="cutoff does not change"):
        stored.analyze(cutoff="20 kHz")
    with pytest.raises(ir.RigError, match="without their recording"):
        stored.analyze()[STEEL].plot()


def test_own_arrays_give_what_the_rig_gives(run, results):
    session = ir.Session(
        {STEEL: "56.32 g", CONTROL: 0.10238},
        hammer_mass="100 g",
        accelerometer_mass="3 g",
        control=CONTROL,
    )
    for name, hits in run.hits.items():
        for hit in hits:
            session.add(hit.hammer, hit.specimen, rate=hit.rate, on=name)
    for name in (STEEL, CONTROL):
        own, rig = session.results[name], results[name]
        for key in ("contact_time", "stiffness", "damping_coefficient"):
            assert getattr(own, key).value == pytest.approx(getattr(rig, key).value, rel=1e-4)
    assert session.hits[STEEL][-1].accepted


def test_arrays_of_several_hits_are_averaged(run):
    hammer = [hit.hammer for hit in run.hits[CONTROL]]
    specimen = [hit.specimen for hit in run.hits[CONTROL]]
    found = ir.estimate(
        hammer, specimen, rate="2.5 MHz", hammer_mass="100 g", sample_mass="102.38 g",
        accelerometer_mass="3 g", control=True,
    )  # fmt: skip
    assert found.impacts_accepted == 4
    assert found.stiffness.value == pytest.approx(22.54e6, rel=0.01)
    twice = ir.estimate(hammer[:2] * 2, specimen[:2] * 2, rate="2.5 MHz")
    assert (twice.impacts_accepted, twice.impacts_rejected) == (2, 2)
    alone = ir.estimate(hammer[0] / 9.80665, rate=2.5e6, unit="g")
    assert alone.contact_time.value == pytest.approx(212e-6, rel=0.01)
    assert not alone.stiffness.is_known
    force = ir.estimate(0.1 * hammer[0], specimen[0], rate=2.5e6, unit="N", sample_mass="102 g")
    assert force.contact_time.value == alone.contact_time.value
    assert not force.stiffness.is_known
    # A force is one without any mass, which cancels where it is stated; acceleration needs it.
    bare, massive = (
        ir.estimate([0.1 * trace for trace in hammer], specimen, rate=2.5e6, unit="N", **known)
        for known in ({}, {"hammer_mass": "100 g"})
    )
    for one, other in zip(
        (bare.peak_force, bare.checks.impulse), (massive.peak_force, massive.checks.impulse),
        strict=True,
    ):  # fmt: skip
        assert one.value == pytest.approx(other.value, rel=1e-6)
        assert one.expanded == pytest.approx(other.expanded, rel=1e-6)
        assert "mass of the hammer, assumed" not in [line.source for line in other.budget]
    assert (bare.record.paper.hammer_peak > 0.0, massive.record.paper.hammer_peak > 0.0) == (
        False, True,
    )  # fmt: skip


def test_a_number_of_one_hit_says_so_wherever_it_is_printed():
    lone, two = (ir.VirtualRig(seed=7).run([CONTROL], count).analyze() for count in (1, 2))
    assert str(lone[CONTROL].contact_time).endswith(" µs, one hit")
    assert f"{lone[CONTROL].contact_time:.1f}".endswith(" µs, one hit")
    assert ", one hit" in str(lone)
    assert "strike 4 times or more" in lone[CONTROL].remarks[0]
    assert "one hit" not in str(two) + str(two[CONTROL].contact_time)


def test_units_and_times_that_arrays_carry_are_taken():
    plain = estimate(HIT.hammer, HIT.specimen)
    feet = [PINT.Quantity(getattr(HIT, name) / 0.3048, "ft/s^2") for name in CHANNELS]
    times = [
        pandas.Series(getattr(HIT, name), index=pandas.to_timedelta(HIT.time, "s"))
        for name in CHANNELS
    ]
    gravities = pandas.Series(HIT.hammer / 9.80665, index=HIT.time)
    gravities.attrs["units"] = "g"
    for found in (
        estimate(*feet, hammer_mass=PINT("0.1 kg"), rate=PINT("2.5 MHz")),
        estimate(*times, rate=None),
        estimate(PINT.Quantity(0.1 * HIT.hammer, "newton"), HIT.specimen),
        estimate(gravities, HIT.specimen, rate=None),
    ):
        assert found.contact_time.value == pytest.approx(plain.contact_time.value, rel=1e-6)
        assert found.peak_force.value == pytest.approx(plain.peak_force.value, rel=1e-6)


def test_channels_in_volts_go_by_their_sensitivities_which_stand_in_the_budgets(run):
    volts = [(0.01 * hit.hammer / 9.80665, -0.02 * hit.specimen) for hit in run.hits[CONTROL]]
    given = {"rate": "2.5 MHz", "hammer_mass": "100 g", "sample_mass": "102.38 g",
             "accelerometer_mass": "3 g"}  # fmt: skip
    found = ir.estimate(
        *zip(*volts, strict=True), unit="V", hammer_sensitivity="10 mV/g",
        specimen_sensitivity="-20 mV/(m/s^2)", sensitivity_uncertainty=0.02, **given,
    )  # fmt: skip
    plain = [(hit.hammer, hit.specimen) for hit in run.hits[CONTROL]]
    plain = ir.estimate(*zip(*plain, strict=True), **given)
    assert found.peak_force.value == pytest.approx(plain.peak_force.value, rel=1e-6)
    (line, *_) = found.peak_force.budget
    assert line.source == "gain of the hammer's channel"
    assert line.contribution == pytest.approx(0.02 * found.peak_force.value, rel=1e-6)


@pytest.mark.parametrize(("mass", "factor", "is_doubted"), [
    (0.1, 165.0, False), (0.1, 168.0, True), (69.0, 1.0, False), (70.0, 1.0, True)
])  # fmt: skip
def test_what_no_hammer_does_is_one_remark(mass, factor, is_doubted, recwarn):
    """Of 0.06 m/s and 724 m/s²: above 10 m/s, or 50 kN, a unit or a mass may be another one."""
    session = ir.Session({STEEL: "56 g"}, hammer_mass=mass)
    for _ in range(2):
        session.add(factor * HIT.hammer, rate=HIT.rate, on=STEEL)
    told = [str(item.message) for item in recwarn] + session.results.warnings
    assert sum("no hammer does that" in text for text in told) == 2 * is_doubted


def test_a_hit_of_another_run_is_not_taken_for_one_of_its_name(run):
    other = ir.VirtualRig(seed=8).run([STEEL, CONTROL], 4)
    with pytest.raises(ir.RigError, match=r"hit steel small/3\.1 is of another run"):
        run.analyze(reject=other.hits[STEEL][2])


def test_a_setting_is_swept_over_a_run(recording, run):
    found = ir.open_run(recording).sweep(cutoff=["20 kHz", 30e3])
    assert list(found) == ["20 kHz", 30e3]
    assert str(found[30e3]) == str(ir.open_run(recording).analyze(cutoff=30e3))
    with pytest.raises(ir.RigError, match="sweep changes one setting, not 2"):
        run.sweep(cutoff=[1e3], pulse_factor=[2.0])


def test_a_hit_that_is_rejected_says_why():
    reason = "hit 1.1 is rejected: truncated: the pulse is cut off"
    with pytest.raises(ir.RigError, match=f"sample: .*{reason}"):
        estimate(HIT.hammer[:700])
    session = ir.Session({STEEL: None})
    session.add(HIT.hammer[:700], rate="2.5 MHz", on=STEEL)
    assert reason in str(session.results[STEEL])
    assert "no hit was accepted: truncated (1)" in str(session.results)
    assert str(session.results[STEEL].notes[0]) == "hits: 0 of 1 accepted"


def test_hits_that_are_added_together_are_all_taken_or_none(run):
    session = ir.Session({STEEL: None})
    hits = [hit.hammer for hit in run.hits[STEEL]]  # not all of one length
    with pytest.raises(ir.RigError, match="hit 5: hammer is nan"):
        session.add([*hits, np.full(50, np.nan)], rate="2.5 MHz", on=STEEL)
    session.add(tuple(hits), rate="2.5 MHz", on=STEEL)
    assert session.results[STEEL].impacts_accepted == 4


def test_files_of_other_instruments_are_read_by_wildcard(run, tmp_path):
    for place, hit in enumerate(run.hits[STEEL]):
        np.save(tmp_path / f"hit{place}.npy", np.stack([hit.hammer, hit.specimen], axis=1)[:4900])
    files = ir.read_files(
        tmp_path / "hit*.npy",
        rate="2.5 MHz",
        hammer_mass="100 g",
        sample=STEEL,
        hammer_unit="m/s^2",
    )
    assert files.analyze()[STEEL].impacts_accepted == 4
    assert len(files.hits[STEEL]) == 4
    (tmp_path / "hit9.npy").write_bytes(b"no hit")
    with pytest.warns(UserWarning, match=r"left out: .*hit9\.npy"):
        rest = ir.read_files(tmp_path / "hit*.npy", rate="2.5 MHz", hammer_unit="m/s^2")
    assert len(rest.hits["sample"]) == 4
    plain = {"rate": "2.5 MHz", "hammer_unit": "m/s^2"}
    chosen = ir.read_files(tmp_path / "hit1.npy", hammer_channel=2, sample_channel="1", **plain)
    assert np.array_equal(chosen.hits["sample"][0].hammer, run.hits[STEEL][1].specimen[:4900])
    with pytest.raises(ir.RigError, match=r'give rate="25\.6 kHz", or write'):
        ir.read_files(tmp_path / "hit1.npy")
    warnings = ir.read_files(tmp_path / "hit1.npy", rate=2.5e6).analyze().warnings
    assert "its peaks have none (hammer_unit)" in warnings[0]
    with pytest.raises(ir.RigError, match="no file is called like"):
        ir.read_files(tmp_path / "*.tdms")
    with pytest.raises(ir.RigError, match="rate"):
        ir.read_files(tmp_path / "hit*.npy")


def test_the_same_seed_gives_the_same_hits_and_faults_are_named():
    rigs = [ir.VirtualRig(seed=3, plant="contact", faults=0.5) for _ in range(2)]
    first, second = ([rig.strike(STEEL) for _ in range(5)] for rig in rigs)
    assert all(np.array_equal(a.hammer, b.hammer) for a, b in zip(first, second, strict=True))
    assert {fault for hit in first for fault in hit.truth.faults}
    assert first[0].truth.exponent == 1.5


VIRTUAL_RIG = """
[hammer]
mass = "100 g"
impact_speed = "10 cm/s"
[samples]
control = "disc"
[[sample]]
name = "disc"
material = "steel"
mass = "100 g"
[source]
driver = "virtual"
plant = "contact"
seed = 4
contact_exponent = 2.0
restitution = 0.7
noise = 0.02
sampling_rate = "1 MHz"
"""


def test_a_rig_file_is_the_same_virtual_rig_for_the_library_as_for_its_node(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(VIRTUAL_RIG)
    found = ir.VirtualRig(rig_file=path).strike("disc")
    given = load_rig_file(path)
    source, plan = make_source(given.source, given.setup)
    source.configure(plan)
    source.take_setup(given.setup)
    wanted = source.strike(found.label, 0.0)
    assert np.array_equal(found.hammer, wanted.hammer.acceleration)
    assert found.rate == 1e6
    assert found.truth.exponent == 2.0
    assert found.truth.restitution == pytest.approx(0.7, rel=0.03)  # it scatters with the speed
    other = ir.VirtualRig(rig_file=path, seed=5, restitution=0.9).strike("disc")
    assert other.truth.exponent == 2.0
    assert other.truth.restitution == pytest.approx(0.9, rel=0.03)
    path.write_text(VIRTUAL_RIG.replace('driver = "virtual"', 'driver = "sound"'))
    device = ir.VirtualRig(rig_file=path, plant="contact").strike("disc")
    assert (device.rate, device.truth.exponent) == (1e6, 1.5)  # how it is sampled, no physics


def test_a_sample_is_planned_beside_those_of_the_rig():
    mine = {"mass": 0.06, "reference_contact_time": "180 us", "reference_stiffness": 30e6,
            "reference_damping_coefficient": "300 N s/m"}  # fmt: skip
    rig = ir.VirtualRig(samples={"mine": mine}, noise=1e-4, bits=16)
    found = rig.run(["mine", CONTROL], 4).analyze()["mine"]
    assert found.contact_time.value == pytest.approx(180e-6, rel=0.005)
    assert rig.strike("mine").truth.stiffness == 30e6
    assert STEEL in rig.samples


@pytest.fixture(scope="module")
def recording(run, tmp_path_factory):
    """Return a recording of the same hits, as another instrument's."""
    session = ir.Session({STEEL: "56.32 g", CONTROL: "102.38 g"}, hammer_mass="100 g")
    for name, hits in run.hits.items():
        for hit in hits:
            session.add(hit.hammer, hit.specimen, rate=hit.rate, on=name)
    path = tmp_path_factory.mktemp("run") / "session.mcap"
    hits = [replace(hit, path=README) for hit in session._source.hits]  # any file: it is hashed
    write_imported(path, session._source.setup, hits)
    return path


def test_a_recording_is_opened_by_file_and_by_folder(recording, run):
    for place in (recording, recording.parent, str(recording)):
        opened = ir.open_run(place)
        assert opened.analyze()[STEEL].impacts_accepted == 4
    hit = opened.hits[STEEL][2]
    assert np.array_equal(hit.hammer, run.hits[STEEL][2].hammer)
    assert hit.truth is None
    with pytest.raises(ir.RigError, match="holds 1 campaign: choose one with campaign=1"):
        ir.open_run(recording, campaign=2)
    with pytest.raises(ir.RigError, match="campaign is '1': it must be a whole number"):
        ir.open_run(recording, campaign="1")


@pytest.fixture
def often():
    """Let threads interrupt each other within a pass."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(before)


def count_blas_threads():
    return [item["num_threads"] for item in threadpool_info() if item["user_api"] == "blas"]


@pytest.mark.usefixtures("often")
@pytest.mark.parametrize("library", ["concurrent.futures", "dask"])
def test_one_run_is_read_by_many_threads_at_once(recording, library):
    opened = ir.open_run(recording)
    wanted = str(opened.analyze(cutoff="20 kHz"))
    names = [hit.name for hits in opened.hits.values() for hit in hits]
    fresh = ir.open_run(recording)

    def analyze(_):
        found = [hit.name for hits in fresh.hits.values() for hit in hits]
        return str(fresh.analyze(cutoff="20 kHz")), found

    with threadpool_limits(2, "blas"):
        before = count_blas_threads()
        if library == "dask":
            dask = pytest.importorskip("dask")
            tasks = [dask.delayed(analyze)(number) for number in range(24)]
            found = dask.compute(*tasks, scheduler="threads", num_workers=8)
        else:
            with ThreadPoolExecutor(8) as threads:
                found = list(threads.map(analyze, range(24)))
        assert count_blas_threads() == before
    assert [*found] == [(wanted, names)] * 24
    assert max(before) == 2


def test_the_readme_s_lines_run_as_they_are_typed(recording, run, tmp_path, monkeypatch):
    (text, _) = re.findall(r"```python\n(.*?)```", README.read_text("utf-8"), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs").mkdir()
    shutil.copytree(recording.parent, tmp_path / "runs" / "<time>")
    (tmp_path / "bench").mkdir()
    hit = run.hits[STEEL][0]
    channels = [
        MeasuredChannel(name, values, hit.rate, "m/s^2")
        for name, values in (("hammer", hit.hammer), ("sample", hit.specimen))
    ]
    write_measurement(tmp_path / "bench" / "hit.csv", Measurement(tmp_path, tuple(channels)))
    text = text.replace("tdms", "csv")  # which is read only
    if find_spec("pandas") is None:
        text = text.replace("results.to_dataframe()", "pass")
    known = {
        "hammer": hit.hammer,
        "specimen": hit.specimen,
        "mine": lambda hit: np.ptp(hit.time[np.abs(hit.hammer) > 0.05 * np.abs(hit.hammer).max()]),
    }
    exec(compile(text, README, "exec"), known)
    assert (tmp_path / "steel.png").stat().st_size > 10_000
    assert max(abs(found.bias) for found in known["scores"]) < 0.15
    assert len(known["scores"]) == 12


def list_shown(notebook):
    outputs = [item for cell in notebook.cells for item in cell.get("outputs", ())]
    return [item["data"] for item in outputs if "data" in item]


def test_the_notebook_runs_from_its_first_cell_to_its_last(tmp_path, monkeypatch):
    nbclient, nbformat = map(pytest.importorskip, ("nbclient", "nbformat"))
    for folder in ("RUNTIME", "CONFIG", "DATA"):
        monkeypatch.setenv(f"JUPYTER_{folder}_DIR", str(tmp_path))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
    notebook = nbformat.read(README.parent / "impact_rig" / "notebook.ipynb", 4)
    committed = list_shown(notebook)
    asked = "print(max(map(abs, errors['steel small'])))"
    notebook.cells.append(nbformat.v4.new_code_cell(asked))
    place = {"metadata": {"path": str(tmp_path)}}
    nbclient.NotebookClient(notebook, timeout=60, resources=place).execute()
    shown = list_shown(notebook)
    # The sample's figure, that of own files, and of the own estimator.
    assert [place for place, data in enumerate(shown) if "image/png" in data] == [2, 4, 5]
    assert [{*data} for data in committed] == [{*data} for data in shown]
    assert [data["text/plain"] for data in committed] == [data["text/plain"] for data in shown]
    # Both are by the log decrement, and the truth differs by as much.
    assert "2 of 7 values changed" in shown[-1]["text/html"]
    assert float(notebook.cells[-1].outputs[-1]["text"]) < 15.0  # [%]
