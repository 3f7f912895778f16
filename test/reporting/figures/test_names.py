import re
import xml.etree.ElementTree as ET

from hypothesis import given
from hypothesis import strategies as st

from impact_rig.reporting.figures.names import LONGEST_NAME, make_name, shorten_name

names = st.text(min_size=1, max_size=40)


@given(names)
def test_a_name_is_fit_for_ids_and_files_on_every_system(name):
    assert re.fullmatch(r"[A-Za-z0-9_-]+", make_name("sample", name))


@given(st.lists(names, min_size=2, max_size=2, unique=True))
def test_different_samples_have_different_names(pair):
    assert make_name("sample", pair[0]) != make_name("sample", pair[1])


def test_a_plain_name_stays_readable():
    assert make_name("", "sample", "steel small") == "sample--steel-small"


@given(st.text())
def test_what_stands_beside_an_axis_fits_and_is_something_that_xml_can_hold(name):
    short = shorten_name(name)
    assert len(short) <= LONGEST_NAME
    element = ET.Element("text")
    element.text = short
    assert (ET.fromstring(ET.tostring(element)).text or "") == short


def test_a_long_name_keeps_its_beginning_and_its_end():
    assert shorten_name("cylinder of brass, lot 1234 A") == "cylinder of…1234 A"
    assert shorten_name("brass small") == "brass small"
