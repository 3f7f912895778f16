"""What a person sees while one recording is analyzed."""

import io
from pathlib import Path

import pytest
from rich.console import Console

from impact_rig.cli.analysis import analysis_progress
from impact_rig.cli.analysis.analysis_progress import AnalysisProgress


def follow(patience: float, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr(analysis_progress, "PATIENCE", patience)
    console = Console(file=io.StringIO(), force_terminal=True, width=100, color_system=None)
    with AnalysisProgress(console, Path("runs/session.mcap")) as bar:
        for report in (
            ("reading", 1_000_000, 80_000_000),
            ("reading", 79_600_000, 80_000_000),
            ("estimating", 0, 12),
            ("estimating", 7, 12),
        ):
            bar.report(*report)
            bar._progress.refresh()
    text: str = console.file.getvalue()  # type: ignore[attr-defined]
    return text


def test_reading_is_told_in_megabytes_and_estimating_in_samples(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    text = follow(0.0, monkeypatch)
    assert "reading runs/session.mcap" in text
    assert "1 of 80 MB" in text
    assert "80 of 80 MB" in text
    assert "estimating " in text
    assert text.index("0 of 12 samples") < text.index("7 of 12 samples")


def test_what_takes_less_than_a_second_shows_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "reading" not in follow(60.0, monkeypatch)
