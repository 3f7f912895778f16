"""Colour in real terminals and in pipes; `test_console.py` has the widths of tables."""

import sys

from .conftest import finish, start_python
from .pseudo_terminal import ESCAPE, open_terminal

TABLE = """
import os
from impact_rig.results.tables import Column
from impact_rig.present.terminal.console import ALARM, make_console, print_table

column = Column("Verdict", ("rejected", "accepted"), is_text=True, styles=(ALARM, ""))
for environment in %r:
    os.environ.update(environment)
    print_table(make_console(), "Hits", [column], ["A note."])
    for name in environment:
        del os.environ[name]
    print("\\f", end="", flush=True)
"""
ALARM = "\x1b[1;38;5;166m"
"""Bold vermilion, of 256 colours."""


def run_in_pipe(*words):
    """Return what a program prints into a pipe; in one process rich keeps its first colours."""
    code, output, errors = finish(start_python("-c", *words, env={"COLUMNS": None}))
    assert code == 0, errors
    assert "\x1b" not in errors
    return output


def test_colour_is_for_terminals_and_says_nothing_alone():
    xterm = {"TERM": "xterm-256color"}
    shown = ({**xterm}, {**xterm, "NO_COLOR": "1"}, {"TERM": "dumb"})
    with open_terminal((sys.executable, "-c", TABLE % (shown,))) as terminal:
        assert terminal.finish() == 0
        coloured, uncoloured, dumb, _ = terminal.raw.split("\f")
        texts = terminal.text.split("\f")[:3]
    assert ALARM in coloured
    assert "38;" not in uncoloured
    assert "\x1b" not in dumb
    plain, forced, _ = run_in_pipe(TABLE % (({}, {"FORCE_COLOR": "1", **xterm}),)).split("\f")
    assert "\x1b" not in plain
    assert ALARM in forced
    assert {*texts, ESCAPE.sub("", forced)} == {plain}
