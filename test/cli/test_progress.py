"""The progress bar in real terminals: it shows the work, and leaves nothing behind."""

import re
import signal
import sys

from .pseudo_terminal import HIDE_CURSOR, SHOW_CURSOR, find_widest, open_terminal

PROGRAM = """
import sys, time
from impact_rig.cli.progress import show_progress
from impact_rig.present.terminal.console import make_console

with show_progress() as follow:
    for stage in "reading steel", "estimating":
        for done in range(int(sys.argv[1])):
            follow(stage, done, 20)
            print(f"step {done}", flush=True) if done == 8 else time.sleep(0.02)
print("the end")
"""


def make_words(steps=20):
    return [sys.executable, "-c", PROGRAM, str(steps)]


def test_there_is_a_bar_for_each_stage_and_what_is_printed_meanwhile_stays():
    with open_terminal(make_words(), 60) as terminal:
        assert terminal.finish() == 0
        assert find_widest(terminal.text) <= 60
        assert "95%" in terminal.text
        assert "━" in terminal.text
        assert terminal.text.index("reading steel") < terminal.text.index("estimating")
    assert play(terminal.raw) == ["step 8", "step 8", "the end"]
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


def test_ctrl_c_leaves_the_terminal_as_it_was():
    with open_terminal(make_words(steps=10_000), 120) as terminal:
        terminal.read_until(lambda raw: "reading steel" in raw)
        terminal.process.send_signal(signal.SIGINT)
        assert terminal.finish() != 0
    assert HIDE_CURSOR in terminal.raw
    assert terminal.raw.rindex(SHOW_CURSOR) > terminal.raw.rindex(HIDE_CURSOR)


def test_a_pipe_gets_no_bar_even_if_it_is_to_be_coloured(monkeypatch, capsys):
    for name in ("FORCE_COLOR", "TTY_COMPATIBLE"):
        monkeypatch.setenv(name, "1")
    monkeypatch.setattr(sys, "argv", ["-c", "10"])
    exec(PROGRAM, {})
    assert capsys.readouterr() == ("step 8\nstep 8\nthe end\n", "")
