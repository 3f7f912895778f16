"""Libraries that are missing, broken or old."""

from pathlib import Path

import pytest

from impact_rig.cli.checks.findings import Status
from impact_rig.cli.checks.software_checks import Library, check_libraries, check_python


@pytest.fixture
def shelf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder whose modules Python finds."""
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return tmp_path


def test_this_python_will_do() -> None:
    assert check_python().status is Status.OK


def test_what_loads_is_shown_with_its_version() -> None:
    (finding,) = check_libraries([Library("numpy", ("numpy",), "all", (1, 26))])
    assert finding.status is Status.OK
    assert finding.text[0].isdigit()


@pytest.mark.parametrize(("is_needed", "status"), [(True, "fault"), (False, "warning")])
def test_what_is_missing_matters_as_much_as_it_is_needed(is_needed: bool, status: str) -> None:
    library = Library("absent_here", ("absent-here",), "the view", is_needed=is_needed)
    (finding,) = check_libraries([library])
    assert finding.status.value == status
    assert finding.text == "missing; the view needs it"
    assert finding.advice


def test_what_is_too_old_is_a_fault() -> None:
    (finding,) = check_libraries([Library("numpy", ("numpy",), "all", (99, 0))])
    assert finding.status is Status.FAULT
    assert finding.advice == "install numpy 99.0 or newer"


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("raise OSError('no such library: libx.so')", "libx.so"),
        ("import its_own_dependency", "its_own_dependency"),
        ("import os; os._exit(102)", "102"),
    ],
)
def test_what_does_not_load_is_a_fault_with_the_reason(
    shelf: Path, code: str, reason: str
) -> None:
    (shelf / "broken_here.py").write_text(code)
    (finding,) = check_libraries([Library("broken_here", ("broken-here",), "all")])
    assert finding.status is Status.FAULT
    assert finding.text.startswith("does not load: ")
    assert reason in finding.text
