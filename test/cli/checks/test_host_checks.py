"""Disk and shared memory, good and bad."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from impact_rig.cli.checks import host_checks
from impact_rig.cli.checks.findings import Status


@pytest.mark.parametrize(
    ("free", "status"), [(5e9, Status.OK), (1e9, Status.WARNING), (5e7, Status.FAULT)]
)
def test_a_campaign_needs_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free: float, status: Status
) -> None:
    usage = SimpleNamespace(free=free, total=1e10)
    monkeypatch.setattr(host_checks.shutil, "disk_usage", lambda _: usage)
    finding = host_checks.check_disk(tmp_path)
    assert finding.status is status
    assert bool(finding.advice) == (status is not Status.OK)


def test_a_folder_that_cannot_be_written_is_a_fault(tmp_path: Path) -> None:
    assert host_checks.check_disk(tmp_path / "absent").status is Status.FAULT


def test_shared_memory_may_be_absent_or_small(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert host_checks.check_shared_memory(tmp_path / "absent").status is Status.WARNING
    assert host_checks.check_shared_memory(tmp_path).status is Status.OK
    usage = SimpleNamespace(free=1e6, total=6.4e7)
    monkeypatch.setattr(host_checks.shutil, "disk_usage", lambda _: usage)
    finding = host_checks.check_shared_memory(tmp_path)
    assert finding.status is Status.WARNING
    assert "1 MB of 64 MB" in finding.text
