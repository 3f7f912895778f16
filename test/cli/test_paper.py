"""`impact-rig paper`."""

import json

import pytest


def test_the_last_line_counts_the_cells_that_agree(run):
    outcome = run("paper")
    assert outcome.exit_code == 0
    closing = " ".join(outcome.stdout.split())
    assert closing.endswith(
        "Table 3 agrees within 0.1 % in 10 of 12 cells, within 0.5 % in 11;"
        " misprinted: brass medium."
    )
    assert max(map(len, outcome.stdout.splitlines())) <= 80


def test_the_json_holds_the_same(run):
    content = json.loads(run("paper", "--json").stdout)
    assert content["cells_within_0_1_percent"] == 10
    assert content["cells_within_0_5_percent"] == 11
    assert content["misprinted"] == ["brass medium"]
    assert len(content["samples"]) == 12
    assert content["sizes"][-1]["exponent"] == pytest.approx(0.390, abs=5e-4)


def test_the_size_exponent_is_shown_for_each_material_and_for_all(run):
    lines = run("paper").stdout.splitlines()
    assert next(line for line in lines if line.startswith("all ")).split() == [
        *("all", "0.390", "0.012"),
        *("1.0", "1.0", "3.6"),
    ]
    assert "All: 0.8 standard uncertainties from 2/5, 9.4 from 1/2." in " ".join(
        " ".join(lines).split()
    )
