"""`impact-rig bench`."""

import json
from dataclasses import replace

import pytest
from bench import PARTS
from bench import measure as bench_run
from bench.measure import Extent, Figure, Part, at_most

from impact_rig.core.errors import FileError, RigError


@pytest.fixture
def measure(monkeypatch):
    """Return a function that lets all parts give some figures, or an error."""

    def replace(**outcomes):
        def load(name):
            def give(_):
                if isinstance(outcomes[name], RigError):
                    raise outcomes[name]
                return (outcomes[name],)

            return Part(name, f"Title of {name}", give, 1.0)

        monkeypatch.setattr(bench_run, "load_part", load)

    return replace


GOOD = Figure("ratio", (1.5, 1.6, 1.7), "", at_most(2.0), "a note")
BAD = Figure("lost", (3.0,), "blocks", at_most(0))
FREE = Figure("speed", (1234.5,), "MB/s")


def test_the_parts_are_listed(run):
    lines = run("bench", "--list").stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(PARTS)
    assert all(float(line.split()[1]) > 0.0 for line in lines)


def test_all_parts_together_take_five_minutes():
    assert sum(bench_run.load_part(name).seconds for name in PARTS) <= 300.0


def test_reached_goals_are_exit_code_zero(run, measure):
    measure(read=GOOD, write=FREE)
    outcome = run("bench", "read", "write")
    assert outcome.exit_code == 0
    row = next(line for line in outcome.stdout.splitlines() if line.startswith("ratio "))
    assert row.split() == "ratio 1.6 1.55 to 1.65 3 at most 2 reached".split()  # noqa: SIM905
    assert "ratio: a note" in outcome.stdout
    assert "Python" in outcome.stdout
    assert "write: Title of write" in outcome.stderr


def test_a_missed_goal_is_exit_code_one(run, measure):
    measure(stream=BAD)
    outcome = run("bench", "stream")
    assert outcome.exit_code == 1
    assert "MISSED" in outcome.stdout


def test_what_cannot_be_measured_is_exit_code_two_and_costs_no_other(run, measure):
    measure(kill=RigError("the rig does not strike"), read=BAD)
    outcome = run("bench", "kill", "read")
    assert outcome.exit_code == 2
    assert "error: kill: the rig does not strike" in outcome.stderr
    assert "lost" in outcome.stdout


def test_the_json_has_every_measurement(run, measure):
    measure(read=GOOD)
    content = json.loads(run("bench", "read", "--json").stdout)
    assert content["machine"]["cores"] >= 1
    assert content["extent"] == vars(Extent())
    ((part),) = content["parts"]
    (figure,) = part["figures"]
    assert figure["values"] == [1.5, 1.6, 1.7]
    assert (figure["median"], figure["goal"], figure["reached"]) == (1.6, "at most 2", True)


def test_all_parts_have_a_limit_together(run, measure, monkeypatch):
    measure(**dict.fromkeys(PARTS, GOOD))
    outcome = run("bench")
    assert outcome.exit_code == 0
    row = next(line for line in outcome.stdout.splitlines() if line.startswith("the whole bench"))
    assert row.split()[-6:] == ["s", "at", "most", "300", "s", "reached"]
    monkeypatch.setattr(bench_run, "LONGEST_BENCH", 0.0)
    outcome = run("bench", "--json")
    assert outcome.exit_code == 1
    assert json.loads(outcome.stdout)["whole"]["reached"] is False


def test_an_earlier_bench_is_compared_with(run, measure, tmp_path):
    earlier = tmp_path / "bench.json"
    measure(read=GOOD, write=FREE)
    earlier.write_text(run("bench", "read", "write", "--json").stdout)
    measure(read=replace(GOOD, values=(1.9, 1.92, 1.94)), kill=BAD)
    outcome = run("bench", "read", "kill", "--against", str(earlier))
    assert outcome.exit_code == 1
    row = next(line for line in outcome.stdout.splitlines() if line.startswith("ratio "))
    assert row.split()[-4:] == ["reached", "+20.0", "%", "*"]
    row = next(line for line in outcome.stdout.splitlines() if line.startswith("lost "))
    assert row.split()[-1] == "MISSED"
    outcome = run("bench", "read", "--against", str(earlier), "--json")
    ((part,),) = (json.loads(outcome.stdout)["parts"],)
    assert part["figures"][0]["change"] == {
        "percent": pytest.approx(20.0),
        "is_beyond_spread": True,
    }
    assert "warning" not in outcome.stderr


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "cannot be read (No such file or directory)"),
        ("median", "is not JSON"),
        ("[]", "is no result of a bench; `impact-rig bench --json > bench.json` writes one"),
        ('{"parts": [{"name": "read"}], "machine": {}}', "is no result of a bench"),
    ],
)
def test_what_is_no_bench_is_refused_before_anything_is_measured(
    run, measure, tmp_path, text, words
):
    measure()  # A part that were run would fail.
    earlier = tmp_path / "bench.json"
    if text is not None:
        earlier.write_text(text)
    outcome = run("bench", "read", "--against", str(earlier))
    assert outcome.exit_code == 2
    assert f"error: bench {earlier}: {words}" in outcome.stderr


def test_where_the_benchmarks_are_not_installed_it_is_said_where_they_are(tmp_path):
    from impact_rig.cli.bench import load_command

    with pytest.raises(FileError, match=r"launch_scripts/rig\.py bench"):
        load_command(tmp_path).main(["--kills", "3"], standalone_mode=False)
