"""The bench says what it found, what is asked and whether that is missed."""

import importlib
import math

import pytest

from bench import PARTS, damage
from bench.__main__ import main
from bench.measure import Figure


@pytest.mark.parametrize(
    ("value", "goal", "is_missed"),
    [
        (1.0, {"most": 1.0}, False),
        (1.1, {"most": 1.0}, True),
        (0.9, {"least": 1.0}, True),
        (math.nan, {"least": 1.0}, True),
        (math.nan, {}, False),
    ],
)
def test_a_figure_says_whether_its_goal_is_missed(value, goal, is_missed):
    figure = Figure("speed", value, "ms", **goal)
    assert figure.is_missed is is_missed
    assert ("MISSED" in str(figure)) is is_missed


def test_every_part_is_there_and_another_one_is_named(capsys):
    for name, (module, _) in PARTS.items():
        assert hasattr(importlib.import_module(f"bench.{module}"), f"measure_{name}")
    with pytest.raises(SystemExit):
        main(["nonsense"])
    assert "there is no part 'nonsense'" in capsys.readouterr().err


def test_a_crash_is_found_and_the_others_are_read(tmp_path, monkeypatch):
    script = tmp_path / "bench" / "damage.py"
    script.parent.mkdir()
    (script.parent / "__init__.py").touch()
    script.write_text(
        "import json, os, sys\n"
        "for seed in range(int(sys.argv[2]), int(sys.argv[2]) + int(sys.argv[3])):\n"
        "    print(json.dumps({'seed': seed}), flush=True)\n"
        "    if seed == 2: os._exit(9)\n"
        "    fault = 'KeyError: 3' if seed == 3 else ''\n"
        "    print(json.dumps({'seed': seed, 'fault': fault}), flush=True)\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert damage.read_damaged(tmp_path, 1, 4) == ["seed 2: code 9, ", "seed 3, KeyError: 3"]
