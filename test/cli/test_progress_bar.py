"""The progress bar in real terminals: what it shows, and that it leaves nothing behind."""

import io
import re
import signal
import sys

from rich.console import Console
from rich.progress import MofNCompleteColumn, TimeRemainingColumn

from impact_rig.cli.progress_bar import ProgressBar

from .pseudo_terminal import ESCAPE, HIDE_CURSOR, SHOW_CURSOR, find_widest, open_terminal

PROGRAM = """
import sys, time
from rich.progress import MofNCompleteColumn, TimeRemainingColumn
from impact_rig.cli.progress_bar import ProgressBar
from impact_rig.present.terminal.console import make_console

console = make_console(stderr=True)
columns = MofNCompleteColumn(), TimeRemainingColumn()
with ProgressBar(console, sys.argv[1], *columns, total=1e4) as bar:
    for done in range(int(sys.argv[2])):
        bar.update(completed=done, status="last hit, 12.3: accepted, τp 203.20 µs")
        if done == 5:
            console.print("steel small, hit 1.2 rejected: overload")
        print(f"step {done}", flush=True) if done == 8 else time.sleep(0.02)
print("the end")
"""


def make_words(title="steel small", steps=30):
    return [sys.executable, "-c", PROGRAM, title, str(steps)]


def test_the_bar_fits_shows_its_figures_whole_and_goes_and_what_is_told_meanwhile_stays():
    title = "鋼 steel of a long name"
    with open_terminal(make_words(title), 60) as terminal:
        assert terminal.finish() == 0
        assert find_widest(terminal.text) <= 60
        assert "29/10000" in terminal.text
        assert "τp 203.20 µs" in terminal.text.replace("\n", " ")
        assert title in re.sub(r"\s+", " ", terminal.text)
        assert "━" in terminal.text
    screen = play(terminal.raw)
    assert screen == ["steel small, hit 1.2 rejected: overload", "step 8", "the end"]
    assert terminal.raw.rindex(SHOW_CURSOR) > terminal.raw.rindex(HIDE_CURSOR)


def play(raw):
    """Return the lines that a terminal shows in the end: what rich uses of its language."""
    lines, row, column = [""], 0, 0
    for piece in re.findall(r"\x1b\[[0-9;?]*[a-zA-Z]|\r|\n|[^\x1b\r\n]+", raw):
        if piece == "\r":
            column = 0
        elif piece == "\n":
            row += 1
            lines += [""] * (row + 1 - len(lines))
        elif piece.endswith("A"):
            row -= int(piece[2:-1] or 1)
        elif piece == "\x1b[2K":
            lines[row] = ""
        elif not piece.startswith("\x1b"):
            line = lines[row].ljust(column)
            lines[row] = line[:column] + piece + line[column + len(piece) :]
            column += len(piece)
    return [line for line in lines if line.strip()]


def test_a_terminal_made_narrower_is_filled_no_further_and_ctrl_c_leaves_it_as_it_was():
    with open_terminal(make_words(steps=10_000), 120) as terminal:
        terminal.read_until(lambda raw: raw.count(STATUS) > 1)
        terminal.resize(44)
        before = len(terminal.raw)
        terminal.read_until(lambda raw: raw.count(STATUS, before) > 3)
        # What was drawn while the size changed may still be as wide as before.
        frames = ESCAPE.sub("", terminal.raw[before:]).split(STATUS)[2:]
        terminal.process.send_signal(signal.SIGINT)
        assert terminal.finish() != 0
    assert max(map(find_widest, frames)) <= 44
    assert HIDE_CURSOR in terminal.raw
    assert terminal.raw.rindex(SHOW_CURSOR) > terminal.raw.rindex(HIDE_CURSOR)


STATUS = "last hit"


def test_a_pipe_gets_no_bar_even_if_it_is_to_be_coloured(monkeypatch, capsys):
    for name in ("FORCE_COLOR", "TTY_COMPATIBLE"):
        monkeypatch.setenv(name, "1")
    monkeypatch.setattr(sys, "argv", ["-c", "steel small", "10"])
    exec(PROGRAM, {})
    output, errors = capsys.readouterr()
    assert output == "step 8\nthe end\n"
    assert "━" not in errors
    assert "hit 1.2 rejected" in errors


def test_a_restarted_bar_counts_from_nought():
    console = Console(file=io.StringIO(), force_terminal=True, width=80)
    with ProgressBar(
        console, "reading", MofNCompleteColumn(), TimeRemainingColumn(), total=9
    ) as bar:
        bar.update(completed=9)
        bar.restart("estimating", 12)
    assert "estimating" in console.file.getvalue()  # type: ignore[attr-defined]
    assert " 0/12" in console.file.getvalue()  # type: ignore[attr-defined]
