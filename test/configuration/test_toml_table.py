"""A table of a TOML file is read key by key; what cannot be meant is named with its line."""

import pytest

from impact_rig.configuration.toml_table import REQUIRED, find_lines, parse_toml_table
from impact_rig.core.given.errors import ParameterError

LINES = '''\
# a comment with """ and [brackets]
name = "rig"
text = """
[no.table]
no_key = 1
"""
array = [
  ["a"],
  [ "b" ]
]

[source]
driver = "scpi"  # [not.this]
limits.low = 1

[source . "odd key"]
'a b' = { inner = 3 }

[[sample]]
name = "first"
[sample.extra]
colour = "red"
[[sample]]
name = "second"
[[sample.hole]]
depth = 1
[[sample.hole]]
depth = 2
[sample.extra]
colour = "blue"
'''


@pytest.mark.parametrize(
    ("path", "written"),
    [
        (("array",), "array = ["),
        (("source",), "[source]"),
        (("source", "driver"), 'driver = "scpi"  # [not.this]'),
        (("source", "limits"), "limits.low = 1"),
        (("source", "odd key", "a b"), "'a b' = { inner = 3 }"),
        (("sample", 0, "extra", "colour"), 'colour = "red"'),
        (("sample", 1, "name"), 'name = "second"'),
        (("sample", 1, "hole", 1, "depth"), "depth = 2"),
        (("sample", 1, "extra", "colour"), 'colour = "blue"'),
    ],
)
@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_every_way_to_write_a_key_is_found(path, written, ending):
    line = find_lines(LINES.replace("\n", ending))[path]
    assert LINES.split("\n")[line - 1] == written


TEXT = """\
name = "rig"
port = 5000
ratio = 0.5
inverted = true
rate = "2.5 MHz"
day = 2026-03-01
same_day = "2026-03-01"

[source]
driver = "scpi"

[[sample]]
name = "oak"
[[sample]]
mass = 3
"""


@pytest.fixture
def table():
    return parse_toml_table(TEXT)


def test_values_are_read_as_what_they_must_be(table):
    assert table.take_text("name") == "rig"
    assert table.take_choice("name", ("rig", "bench")) == "rig"
    assert table.take_whole("port", 1, 65535) == 5000
    assert table.take_number("ratio", 0.0, 1.0) == 0.5
    assert table.take_boolean("inverted") is True
    assert table.take_quantity("rate", "Hz", "1 MHz") == pytest.approx(2.5e6)
    assert table.take_date("day") == table.take_date("same_day") == "2026-03-01"
    assert dict(table.take_table("source")) == {"driver": "scpi"}
    assert [dict(item) for item in table.take_tables("sample")] == [{"name": "oak"}, {"mass": 3}]


@pytest.mark.parametrize(
    ("take", "told"),
    [
        (lambda table: table.take_text("port"), "line 2: port of the file is 5000: .* quotes"),
        (lambda table: table.take_choice("name", ("a", "b")), "line 1: .* 'rig': .* one of a, b"),
        (lambda table: table.take_whole("ratio", 1, 9), "line 3: .* whole number between 1 and 9"),
        (lambda table: table.take_whole("inverted", 0, 9), "line 4: .* True: .* a whole number"),
        (lambda table: table.take_number("name", 0, 1), "line 1: .* plain number between 0 and 1"),
        (lambda table: table.take_boolean("port"), "line 2: .* true or false"),
        (lambda table: table.take_quantity("rate", "s", "1 s"), "line 5: rate .* is no s"),
        (lambda table: table.take_quantity("port", "s", "1 s"), "line 2: .* has no unit"),
        (lambda table: table.take_quantity("rate", "Hz", "1 Hz", low=1.0, high=3.0),
         "between 1 and 3 Hz"),
        (lambda table: table.take_date("name"), "line 1: name .* is 'rig': .* year-month-day"),
        (lambda table: table.take_table("name"), r"line 1: name is 'rig': .* a table \[name\]"),
        (lambda table: table.take_tables("source"), r"line 9: source: .* \[\[source\]\]"),
        (lambda table: table.take_table("source").take_text("port", REQUIRED),
         r"line 9: \[source\] lacks port"),
        (lambda table: table.take_tables("sample")[1].take_text("mass"),
         "line 15: mass of sample 2 is 3"),
        (lambda table: table.take_table("source").check_keys("drive"),
         r"line 10: \[source\] has an unknown key 'driver': did you mean 'drive'"),
        (lambda table: table.take_table("source").without("drive").check_keys("rate"),
         "did you mean 'drive'"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_named_with_its_line(table, take, told):
    with pytest.raises(ParameterError, match=told):
        take(table)


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "9" * 400])
def test_no_number_and_no_quantity_is_infinite(value):
    table = parse_toml_table(f'number = {value}\nmass = "{value} kg"')
    with pytest.raises(ParameterError, match=r"line 1: .* plain number"):
        table.take_number("number")
    with pytest.raises(ParameterError, match=r"line 2: .* finite number of kg|cannot be read"):
        table.take_quantity("mass", "kg", "1 kg")


@pytest.mark.parametrize(
    ("sentence", "line"),
    [
        ("the same day is wrong, whatever the ratio says", "line 7: "),
        ("what is this", ""),
    ],
)
def test_an_error_of_others_gets_the_line_of_the_longest_key_that_it_is_about(
    table, sentence, line
):
    with pytest.raises(ParameterError) as error, table.locating():
        raise ParameterError(sentence, sentence.partition(" is ")[0])
    assert str(error.value) == line + sentence


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (f"a = {'9' * 5000}", "not TOML"),
        (f"a = {'[' * 5000}", "nested too deep"),
        (f"{'a . ' * 64}a = 1", "a key has more than 64 parts"),
        ("a = 1\nb = \n", r"this is not TOML: .*line 2"),
    ],
)
def test_what_is_no_toml_is_refused(text, told):
    parse_toml_table(f"{'a.' * 63}a = 1")
    with pytest.raises(ParameterError, match=told):
        parse_toml_table(text)
