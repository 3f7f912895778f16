"""Every table in a real terminal of every width, and in pipes."""

import json
import re
import sys
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.results.results_file import format_json, results_to_json

from .conftest import finish, start_python
from .pseudo_terminal import ESCAPE, find_widest, open_terminal

WIDTHS = (60, 132)
PROGRAM = """
import contextlib, fcntl, json, struct, sys, termios
from impact_rig.cli.main import cli

widths, commands = map(json.loads, sys.argv[1:])
for columns in widths:
    if columns:
        fcntl.ioctl(1, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    for words in commands:
        with contextlib.suppress(SystemExit):
            cli(words, prog_name="impact-rig")
        print("\\f", end="", flush=True)
"""
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
"""Bold vermilion, of 256 colours: what a person must look at."""
NUMBER = re.compile(r"(?<![\w.])[+-]?\d+(?:\.\d+)?(?![\w.]*\d)")
REASONS = (
    "overload: 250 points in a row of the hammer at the rail of 1999 m/s^2 (203.8 g)",
    "double_hit: a second pulse of 40 % of the largest follows after 376 µs",
)
NAMES = {
    "steel small": "鋼の試料 第一号 とても長い名前の円柱",
    "brass large": "brass_with_a_name_that_has_no_place_to_break_it",
    "bronze medium": "bronze medium of the second delivery, turned to size",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("widths")


@pytest.fixture
def commands(folder, results):
    """Return commands without ROS that print tables of all kinds."""
    hits = tuple(
        replace(hit, accepted=False, reasons=REASONS, injected_faults=("overload", "double_hit"))
        if place % 3 == 0
        else hit
        for place, hit in enumerate(results.hits)
    )
    text = format_json(results_to_json(replace(results, hits=hits)))
    for name, other in NAMES.items():
        text = text.replace(f'"{name}"', f'"{other}"')
    path = folder / "results.json"
    path.write_text(text, "utf-8")
    times = np.arange(5000) * 1e-6
    pulse = (
        800.0 * np.where(abs(times - 1e-3) < 1e-4, np.cos(np.pi * (times - 1e-3) / 2e-4), 0) ** 2
    )
    traces = []
    for number, factor in enumerate((1.0, 1.01, 0.01), start=1):
        trace = folder / f"a_trace_of_a_long_name_{number}.npy"
        np.save(trace, np.stack((times, factor * pulse)))
        traces.append(str(trace))
    return {
        "results": ["analyze", "--full", str(path)],
        "traces": ["analyze", "--full", *traces, "--hammer-unit", "m/s^2"],
    }


def find_numbers(text):
    return set(NUMBER.findall(text))


def run_in_pipe(*words):
    """Return what a program prints into a pipe; in one process rich keeps its first colours."""
    code, output, errors = finish(start_python("-c", *words, env={"COLUMNS": None}))
    assert code == 0, errors
    assert "\x1b" not in errors
    return output


def make_arguments(commands, *widths):
    """Return what makes the program run all commands one after the other; 0: in a pipe."""
    return json.dumps(widths), json.dumps([*commands.values()])


def test_every_table_fits_every_terminal_and_shows_whole_numbers(commands):
    pages = run_in_pipe(PROGRAM, *make_arguments(commands, 0)).split("\f")
    piped = dict(zip(commands, pages, strict=False))
    check_pipe(piped["results"])
    words = (sys.executable, "-c", PROGRAM, *make_arguments(commands, *WIDTHS))
    with open_terminal(words) as terminal:
        assert terminal.finish() == 0
    pages = iter(terminal.text.split("\f"))
    for columns in WIDTHS:
        for name, whole in piped.items():
            page = next(pages)
            assert "Traceback" not in page
            assert "error:" not in page
            assert find_widest(page) <= columns, (name, columns)
            assert "…" not in page
            assert find_numbers(page) <= find_numbers(whole), (name, columns)


def check_pipe(text):
    """Hold that tables in a pipe are plain, and as wide as they need."""
    lines = text.splitlines()
    for name in NAMES.values():
        assert any(line.startswith(name) for line in lines)
    for reason in REASONS:
        assert any(reason in line for line in lines)
    assert "A wider terminal" not in text
    assert "\x1b" not in text


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
