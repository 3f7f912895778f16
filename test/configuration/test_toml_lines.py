"""Where keys stand in a TOML text is found whatever way they are written."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.configuration.import_file import read_import_template
from impact_rig.configuration.rig_file import read_template
from impact_rig.configuration.toml_lines import find_lines

TEXT = '''\
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
limits.high = 2

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
        (("name",), 'name = "rig"'),
        (("text",), 'text = """'),
        (("array",), "array = ["),
        (("array", 1, 0), "array = ["),
        (("source",), "[source]"),
        (("source", "driver"), 'driver = "scpi"  # [not.this]'),
        (("source", "limits"), "limits.low = 1"),
        (("source", "limits", "high"), "limits.high = 2"),
        (("source", "odd key", "a b", "inner"), "'a b' = { inner = 3 }"),
        (("sample", 0, "name"), 'name = "first"'),
        (("sample", 0, "extra", "colour"), 'colour = "red"'),
        (("sample", 1, "name"), 'name = "second"'),
        (("sample", 1, "hole", 0, "depth"), "depth = 1"),
        (("sample", 1, "hole", 1, "depth"), "depth = 2"),
        (("sample", 1, "extra", "colour"), 'colour = "blue"'),
    ],
)
@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_every_way_to_write_a_key_is_found(path, written, ending):
    line = find_lines(TEXT.replace("\n", ending))[path]
    assert TEXT.split("\n")[line - 1] == written


def list_leaves(value, path=()):
    """Return the path of every value that is no table."""
    if isinstance(value, dict):
        return [leaf for key, item in value.items() for leaf in list_leaves(item, (*path, key))]
    if isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
        return [leaf for index, item in enumerate(value)
                for leaf in list_leaves(item, (*path, index))]  # fmt: skip
    return [path]


@pytest.mark.parametrize("text", [TEXT, read_template(), read_import_template()])
def test_every_key_that_tomllib_reads_has_a_line_that_names_it(text):
    lines = find_lines(text)
    for path in list_leaves(tomllib.loads(text)):
        assert str(path[-1]) in text.split("\n")[lines[path] - 1], path


KEYS = st.lists(
    st.sampled_from(["alpha", "beta", '"gamma delta"', "'[epsilon]'"]), unique=True, max_size=4
)
VALUES = st.sampled_from(
    ["1", '"text"', "[\n1,\n[2],\n]", '"""\n[x]\na = 1\n"""', "'''\n[[sample]]'''", "{a = 1}"]
)
FILLING = st.sampled_from(["", "\n", "# [source]\n", "\n# key = 1\n\n"])


@given(counts=st.lists(st.lists(st.tuples(FILLING, VALUES), max_size=4), max_size=5), keys=KEYS)
def test_a_list_of_tables_is_counted_whatever_stands_in_and_between_them(counts, keys):
    text, expected = "", {}
    for number, table in enumerate(counts):
        expected["sample", number] = text.count("\n") + 1
        text += "[[sample]]\n"
        for key, (filling, value) in zip(keys, table, strict=False):
            text += filling
            expected["sample", number, key.strip("\"'")] = text.count("\n") + 1
            text += f"{key} = {value}\n"
    tomllib.loads(text)
    assert expected.items() <= find_lines(text).items()
