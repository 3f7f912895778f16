"""The bench says what it found, what is asked and whether that is missed."""

import math

import pytest

from bench import PARTS, damage, model, survival
from bench.__main__ import main
from bench.measure import Figure, at_least, at_most, load_part


@pytest.mark.parametrize(
    ("value", "goal", "is_missed"),
    [
        (1.0, at_most(1.0), False),
        (1.1, at_most(1.0), True),
        (1.0, at_least(1.0), False),
        (0.9, at_least(1.0), True),
        (math.nan, at_least(1.0), True),
        (math.nan, None, False),
    ],
)
def test_a_figure_says_whether_its_goal_is_missed(value, goal, is_missed):
    figure = Figure("speed", value, "ms", goal)

    assert figure.is_missed is is_missed
    assert ("MISSED" in str(figure)) is is_missed


def test_every_part_is_there():
    for name in PARTS:
        assert load_part(name).seconds > 0.0


def test_a_part_that_is_not_there_is_named(capsys):
    with pytest.raises(SystemExit):
        main(["nonsense"])
    assert "there is no part 'nonsense'" in capsys.readouterr().err


def test_model_and_integrator_agree(bench):
    differences = [
        figure for figure in model.measure_model(bench) if figure.name.endswith("over the peak")
    ]
    assert len(differences) == 2
    assert not any(figure.is_missed for figure in differences)


def test_the_same_seed_spoils_the_same_bytes():
    data = bytes(range(256)) * 20
    spoilt = [damage.mutate(data, seed) for seed in range(50)]

    assert spoilt == [damage.mutate(data, seed) for seed in range(50)]
    assert sum(item != data for item in spoilt) > 40


def test_a_crash_and_a_hang_are_found_and_the_others_are_read(tmp_path, monkeypatch):
    script = tmp_path / "bench" / "damage.py"
    script.parent.mkdir()
    (script.parent / "__init__.py").touch()
    script.write_text(
        "import json, os, sys, time\n"
        "for seed in range(int(sys.argv[2]), int(sys.argv[2]) + int(sys.argv[3])):\n"
        "    print(json.dumps({'seed': seed}), flush=True)\n"
        "    if seed == 2: os._exit(9)\n"
        "    if seed == 4: time.sleep(600)\n"
        "    outcome = 'KeyError: 3' if seed == 3 else 'read'\n"
        "    print(json.dumps({'seed': seed, 'outcomes': {'read': outcome}}), flush=True)\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(survival, "TIME_LIMIT", 2.0)

    faults = survival._read_damaged(tmp_path, 1, 5)
    assert [fault.split(",")[0].split(":")[0] for fault in faults] == [
        "seed 2",
        "seed 3",
        "seed 4",
    ]
    assert "code 9" in faults[0]
    assert "KeyError: 3" in faults[1]
    assert "no end within 2 s" in faults[2]
