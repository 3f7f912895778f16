"""Tables and texts in terminals of all kinds."""

import io

import pytest
from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

from impact_rig.present.console import (
    make_console,
    print_facts,
    print_item,
    print_table,
    print_text,
    print_warning,
)
from impact_rig.results.table import Column, Table, make_text_column

NAMES = ("aluminium", "試料番号十二の鋼の円柱", "a_name_without_any_place_to_break_it_at")
WHY = "overload: 250 points in a row of the hammer at the rail of 1999 m/s^2"
COLUMNS = (
    Column("Sample", NAMES, is_text=True),
    Column("Measured", ("203.20 ± 0.14", "1170.0 ± 7.9", "-")),
    Column("Why", (WHY, "", WHY), is_text=True, note="Why: in words."),
    Column("w10/w50", ("1.591", "1.590", "-"), is_optional=True, note="w10/w50: the widths."),
)


def render(width: int, columns: tuple[Column, ...] = COLUMNS, **options: object) -> str:
    console = Console(file=io.StringIO(), width=width, **options)  # type: ignore[arg-type]
    print_table(console, Table("A table", columns, ("A note.",), frozenset({0, 2})))
    text: str = console.file.getvalue()  # type: ignore[attr-defined]
    return text


def find_letters(text: str) -> str:
    return "".join(text.split())


@pytest.mark.parametrize("width", [30, 40, 60, 80, 100, 132, 200])
def test_nothing_is_wider_than_the_terminal_whatever_the_names(width):
    text = render(width)
    assert max(map(cell_len, text.splitlines())) <= width
    for number in ("203.20 ± 0.14", "1170.0 ± 7.9"):
        assert number in text
    if width < 40:  # line by line, no cell beside another one
        for words in (*NAMES, WHY):
            assert find_letters(words) in find_letters(text)


def test_a_column_for_which_there_is_no_room_is_named_and_its_note_left_out():
    narrow, wide = render(60), render(200)
    assert "1.591" in wide
    assert "w10/w50: the widths." in wide
    assert "wider" not in wide
    assert "1.591" not in narrow
    assert "w10/w50: the widths." not in narrow
    assert "A wider terminal shows w10/w50 as well." in narrow


def test_what_would_move_the_cursor_is_shown_as_a_mark(capsys):
    name = "tin\x1b[2J\x9b1m\u202e"
    console = make_console()
    print_table(console, Table(name, (make_text_column("Sample", (name,)), Column("n", ("1",)))))
    print_item(console, name)
    print_facts(console, [(name, Text("tin"))])
    print_warning(name)
    console.print(name)
    output = capsys.readouterr()
    text = output.out + output.err
    assert text.replace("\n", "").isprintable()
    assert text.count("tin�[2J�1m�") == 6


def test_paragraphs_and_items_keep_to_lines_that_are_easily_read():
    for width, widest in ((40, 40), (80, 80), (200, 100)):
        console = Console(file=io.StringIO(), width=width)
        print_text(console, WHY * 5)
        print_item(console, WHY * 5)
        lines = console.file.getvalue().splitlines()  # type: ignore[attr-defined]
        assert max(map(len, lines)) <= widest
        first = next(place for place, line in enumerate(lines) if line.startswith("- "))
        assert all(line.startswith("  ") for line in lines[first + 1 :])
