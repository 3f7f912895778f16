"""What a laboratory says of itself, of a report, its items and instruments; what is missing."""

import math

import pytest

from impact_rig.configuration.particulars import TABLES, Item
from impact_rig.configuration.rig_file import parse_rig_file
from impact_rig.core.errors import ParameterError

RIG = """
[hammer]
mass = "0.1 kg"
impact_speed = "30 cm/s"

[[sample]]
name = "oak"
mass = "80 g"
"""


def read(text):
    return parse_rig_file(RIG + text).particulars


def test_what_is_stated_is_read_and_what_is_empty_is_left_out():
    stated = read(
        'serial_number = "batch 7"\nminimum_stiffness = "1 MN/m"\n'
        '[laboratory]\nname = "Lab"\naddress = ""\n[report]\nissued = 2026-05-04\n'
        '[digitizer]\nmodel = "6115"\n[source.hammer]\ncertificate = "D-K-1"\n'
    )
    assert stated.list_facts("laboratory") == [("Laboratory", "Lab")]
    assert stated.list_facts("report") == [("Date of issue", "2026-05-04")]
    assert stated.get("digitizer", "model") == "6115"
    assert stated.list_facts("source.hammer") == [("Certificate", "D-K-1")]
    item = Item({"serial_number": "batch 7"}, {"stiffness": (1e6, math.inf)})
    assert stated.find_item("oak") == item
    assert stated.find_item("ash") == Item()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('[laboratory]\nnam = "Lab"', r"line 10: \[laboratory\] has an unknown key 'nam'.*'name'"),
        ("[report]\nnumber = 4711", "line 10: number of .report. is 4711: .* a text in quotes"),
        ('[balance]\ncapacity = "1 kg"', "unknown key 'capacity'"),
        ('maximum_stiffness = "1 mm"', "line 9: maximum_stiffness .* is no N/m"),
        (
            'minimum_contact_time = "2 ms"\nmaximum_contact_time = "1 ms"',
            "line 9: minimum_contact_time .* below maximum_contact_time",
        ),
    ],
)
def test_what_cannot_be_meant_is_named_with_its_line(text, told):
    with pytest.raises(ParameterError, match=told):
        read(text)


def test_a_text_is_set_in_place_of_that_of_the_file_or_taken_away():
    stated = read('[report]\nnumber = "1"\noperator = "A. Berg"\n')
    changed = stated.set(["report.number=2 = two", "report.operator=", "digitizer.model=X"])
    assert changed.list_facts("report") == [("Report number", "2 = two")]
    assert changed.get("digitizer", "model") == "X"
    assert stated.get("report", "number") == "1"
    with pytest.raises(
        ParameterError, match=r"'report.nummer=3' sets nothing.*report.number=TEXT"
    ):
        stated.set(["report.nummer=3"])


def test_what_the_standard_asks_for_is_listed_until_it_is_stated():
    lacking = read("").list_lacking(["oak"])
    for text in ("(7.8.2.1 b): name in [laboratory]", "(7.8.2.1 d): number in [report]",
                 "Certificate of the hammer sensor (6.5.1): certificate in [source.hammer]",
                 "Serial or batch of all samples (7.8.2.1 g)"):  # fmt: skip
        assert any(text in item for item in lacking), text
    whole = read('serial_number = "7"\ndimensions = "30 mm"\n').set(
        f"{table}.{entry.key}=x" for table, entries in TABLES.items() for entry in entries
    )
    assert whole.list_lacking(["oak"]) == []
    unexplained = whole.set(["report.changes="]).list_lacking(["oak"])
    assert unexplained == ["Changed, and why (7.8.8.2): changes in [report]"]
    assert [item[:24] for item in whole.list_lacking(["oak", "ash"])] == [
        "Serial or batch of ash (", "Dimensions of ash (7.8.2",
    ]  # fmt: skip
