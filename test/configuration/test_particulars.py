"""Facts of laboratory, report, items and instruments, and which of them are missing."""

import math

import pytest

from impact_rig.configuration.particulars import SAMPLE, TABLES, Particulars, read_particulars
from impact_rig.configuration.rig_file import parse_rig_file
from impact_rig.core.given.errors import ParameterError

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
    assert stated.get("sample.oak", "serial_number") == "batch 7"
    assert stated.limits == {"oak": {"stiffness": (1e6, math.inf)}}
    assert stated.samples == ["oak"]


def test_a_laboratory_keeps_its_address_in_a_file_of_its_own():
    own = read_particulars('[laboratory]\nname = "Lab"\n[source.hammer]\nserial_number = "2"\n')
    recorded = read(
        '[laboratory]\nplace = "hall 3"\n'
        '[source.hammer]\nserial_number = "1"\ncertificate = "D-K-1"\n'
    )
    both = own.put_over(recorded)
    assert both.texts["laboratory"] == {"name": "Lab", "place": "hall 3"}
    assert both.texts["source.hammer"] == {"serial_number": "2"}  # certificate 1 is not of it
    assert Particulars().put_over(recorded) == recorded
    with pytest.raises(ParameterError, match=r"line 2: the file has an unknown key 'laboratry'"):
        read_particulars('\n[laboratry]\nname = "Lab"')


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('[laboratory]\nnam = "Lab"', r"line 10: \[laboratory\] has an unknown key 'nam'.*'name'"),
        ("[report]\nnumber = 4711", "line 10: number of .report. is 4711: .* a text in quotes"),
        (
            '[report]\nissued = "May 4"',
            "line 10: issued of .report. is 'May 4': it must be a date",
        ),
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
    changed = stated.set(
        [
            "report.number=2 = two",
            "report.operator=",
            "digitizer.model=X",
            "sample.oak.dimensions=3",
        ]
    )
    assert changed.get("sample.oak", "dimensions") == "3"
    assert changed.list_facts("report") == [("Report number", "2 = two")]
    assert changed.get("digitizer", "model") == "X"
    assert stated.get("report", "number") == "1"
    for wrong, told in (
        ("report.nummer=3", "'report.nummer=3' sets nothing: write it like report.number=TEXT"),
        ("sample.serial_number=3", "write it like sample.NAME.serial_number=TEXT"),
        ("report.number", "'report.number' sets nothing"),
        ("report.issued=4.5.26", "issued of .report. is '4.5.26': it must be a date"),
    ):
        with pytest.raises(ParameterError, match=told):
            stated.set([wrong])


def test_dates_that_cannot_be_true_are_named():
    tested = "2026-05-04", "2026-05-05"
    good = {"received": "2026-05-04", "tested": "2026-05-05", "issued": "2026-05-05"}
    assert Particulars({"report": good}).list_contradictions(*tested, "2026-06-01") == []
    for key, day, told in (
        ("received", "2026-05-05", "received on 2026-05-05, after the tests began on 2026-05-04"),
        ("issued", "2026-06-02", "issued on 2026-06-02, and today is 2026-06-01"),
        ("issued", "2026-05-04", "issued on 2026-05-04, before the tests ended on 2026-05-05"),
        ("tested", "2026-05-06", "the tests are dated 2026-05-06, and the recording 2026-05-04"),
    ):
        (found,) = Particulars({"report": {key: day}}).list_contradictions(*tested, "2026-06-01")
        assert told in found
    (found,) = Particulars(
        {"report": {"tested": "2026-05-06", "issued": "2026-05-04"}}
    ).list_contradictions("", "", "2026-06-01")
    assert "before the tests ended on 2026-05-06" in found


@pytest.mark.parametrize(
    ("stated", "told"),
    [
        ({"replaces": "41"}, "replaces 41 and does not say what changed"),
        ({"replaces": "41", "number": "41", "changes": "x"}, "report 41 replaces itself"),
        ({"replaces": "41", "number": "42", "changes": "x"}, None),
    ],
)
def test_a_report_replaces_another_one_and_says_what_changed(stated, told):
    particulars = Particulars({"report": stated})
    if told is None:
        particulars.check_replacement()
        return
    with pytest.raises(ParameterError, match=told):
        particulars.check_replacement()


def test_what_the_standard_asks_for_is_listed_until_it_is_stated():
    lacking = read("").list_lacking(["oak"], is_dated=False)
    for text in ("(7.8.2.1 b): name in [laboratory]", "(7.8.2.1 d): number in [report]",
                 "Certificate of the hammer sensor (6.5.1): certificate in [source.hammer]",
                 "Date of the tests (7.8.2.1 i): tested in [report]",
                 "Serial or batch of all samples (7.8.2.1 g)"):  # fmt: skip
        assert any(text in item for item in lacking), text
    whole = read('maximum_stiffness = "1 MN/m"').set(
        f"{table}.{entry.key}={'2026-05-04' if entry.is_date else 'x'}"
        for table, entries in {**TABLES, "sample.oak": SAMPLE}.items()
        for entry in entries
    )
    assert whole.list_lacking(["oak"], is_dated=False) == []
    unexplained = whole.set(["report.changes=", "report.specification=", "report.tested="])
    assert unexplained.list_lacking(["oak"], is_dated=True) == [
        "Changed, and why (7.8.8.2): changes in [report]",
        "Specification, what sets the limits (7.8.6.2 b): specification in [report]",
    ]
    (opinions,) = whole.set(["report.opinions_by="]).list_lacking(
        ["oak"], is_dated=True, has_opinions=True
    )
    assert "(7.8.7.1): opinions_by" in opinions
    assert [item[:24] for item in whole.list_lacking(["oak", "ash"], is_dated=True)] == [
        "Serial or batch of ash (", "Dimensions of ash (7.8.2",
    ]  # fmt: skip


def test_a_limit_is_set_beside_that_of_the_file_or_taken_away():
    stated = read('maximum_contact_time = "1 ms"')
    (name,) = stated.samples
    key = f"sample.{name}.minimum_contact_time"
    limited = stated.set([f"{key}=169.9 us"], [name])
    assert limited.limits[name]["contact_time"] == pytest.approx((169.9e-6, 1e-3))
    assert limited.set([f"{key}="]).limits == stated.limits
    for wrong, told in (
        (f"{key}=2 ms", "is '2 ms': it must be below maximum_contact_time"),
        (f"sample.{name}.maximum_contact_time=1 us", "must be above minimum_contact_time"),
        (f"{key}=2 kg", "is no s"),
        ("sample.oka.dimensions=3", f"unknown sample 'oka': there are '{name}'"),
    ):
        with pytest.raises(ParameterError, match=told):
            limited.set([wrong], [name])


def test_what_no_report_takes_of_a_rig_file_is_known():
    text = '[hammer]\nmass = "1 g"\n[source.hammer]\nmodel = "X"\ngain = 2\n[[sample]]\n'
    unused = read_particulars(text + 'name = "oak"\nmass = "2 g"\ndimensions = "3 mm"\n').unused
    assert unused == {"hammer.mass": "1 g", "source.hammer.gain": 2, "sample.oak.mass": "2 g"}
