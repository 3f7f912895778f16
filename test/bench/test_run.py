"""The bench as a whole: what is asked is run, what cannot be run costs no other part."""

from types import SimpleNamespace

import pytest

from impact_rig.bench import run
from impact_rig.bench.figures import Figure, at_most
from impact_rig.bench.part import Bench, Extent, Part
from impact_rig.bench.part_names import PARTS
from impact_rig.core.errors import RigError


def measure_well(bench: Bench) -> tuple[Figure, ...]:
    assert not list(bench.folder.iterdir())
    (bench.folder / "left.behind").touch()
    bench.report(1, 2)
    return (Figure("good", (1.0,), goal=at_most(2)), Figure("bad", (3.0,), goal=at_most(2)))


def fail(_: Bench) -> tuple[Figure, ...]:
    raise RigError("it cannot be measured here")


def miss(_: Bench) -> tuple[Figure, ...]:
    raise ModuleNotFoundError("No module", name="rclpy")


@pytest.fixture
def parts(monkeypatch: pytest.MonkeyPatch) -> None:
    functions = {"well": measure_well, "fails": fail, "lacks": miss}

    def find(name: str) -> SimpleNamespace:
        name = name.rpartition(".")[2]
        return SimpleNamespace(PART=Part(name, f"Title of {name}", functions[name], 1.0))

    monkeypatch.setattr(run.importlib, "import_module", find)


@pytest.mark.usefixtures("parts")
def test_a_part_that_cannot_be_run_costs_no_other() -> None:
    results = run.run_parts(["fails", "lacks", "well"], Extent(), lambda *_: None)
    assert [len(part.figures) for part in results.parts] == [0, 0, 2]
    assert results.errors == (
        "fails: it cannot be measured here",
        "lacks: Python finds no module 'rclpy': see `impact-rig doctor`",
    )
    assert [figure.name for figure in results.missed] == ["bad"]


@pytest.mark.usefixtures("parts")
def test_progress_is_told_by_part() -> None:
    told: list[tuple[str, int, int]] = []
    run.run_parts(
        ["well"], Extent(), lambda part, done, total: told.append((part.name, done, total))
    )
    assert told == [("well", 0, 0), ("well", 1, 2)]


@pytest.mark.parametrize("name", PARTS)
def test_every_part_says_its_name_and_what_it_measures(name: str) -> None:
    part = run.load_part(name)
    assert part.name == name
    assert part.title


def test_the_machine_is_named() -> None:
    machine = run.run_parts([], Extent(), lambda *_: None).machine
    assert machine.cores >= 1
    assert machine.processor
    assert machine.memory_byte > 1e8
