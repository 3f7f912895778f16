"""The progress bar in real terminals: it shows the work, and leaves nothing behind."""

import re
import sys

from rich.cells import cell_len
from terminal import Terminal, make_colourful

SHOW_CURSOR, HIDE_CURSOR = "\x1b[?25h", "\x1b[?25l"
ERASE_LINE = "\x1b[2K"

PROGRAM = """
import sys, time
from impact_rig.cli.output import show_progress
from impact_rig.present.console import make_console

with show_progress() as follow:
    for stage in "reading steel", "estimating":
        for done in range(int(sys.argv[1])):
            follow(stage, done, 20)
            print(f"step {done}", flush=True) if done == 8 else time.sleep(0.02)
print("the end")
"""


def test_there_is_a_bar_for_each_stage_and_what_is_printed_meanwhile_stays():
    words = (sys.executable, "-c", PROGRAM, 20)
    with Terminal(words, make_colourful(), columns=60) as terminal:
        assert terminal.wait() == 0
        assert max(map(cell_len, re.split(r"[\r\n]", terminal.text))) <= 60
        assert "95%" in terminal.text
        assert "━" in terminal.text
        assert terminal.text.index("reading steel") < terminal.text.index("estimating")
    assert terminal.text.count("step 8") == 2
    # The bars are erased in the end.
    left = terminal.raw.rpartition(ERASE_LINE)[2]
    assert left.endswith("the end\r\n")
    assert "━" not in left
    assert terminal.raw.rindex(SHOW_CURSOR) > terminal.raw.rindex(HIDE_CURSOR)


def test_a_pipe_gets_no_bar_even_if_it_is_to_be_coloured(monkeypatch, capsys):
    for name in ("FORCE_COLOR", "TTY_COMPATIBLE"):
        monkeypatch.setenv(name, "1")
    monkeypatch.setattr(sys, "argv", ["-c", "10"])
    exec(PROGRAM, {})
    assert capsys.readouterr() == ("step 8\nstep 8\nthe end\n", "")
