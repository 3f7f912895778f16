"""The figure is drawn from whatever was found, the same each time."""

import math
import xml.etree.ElementTree as ET

import pytest

from impact_rig.study.campaigns import ESTIMATED
from impact_rig.study.cases import ESTIMATORS, Configuration, Part, list_cases
from impact_rig.study.files import draw_figure
from impact_rig.study.results import Bias, Ratio, Row, StudyResults

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def make_results(parts, figure):
    rows = tuple(
        Row(
            part=part,
            axis=case.axis,
            value=case.value,
            position=case.position,
            estimator=estimator,
            quantity=quantity,
            campaigns=9,
            determined=9,
            bias=Bias(figure, figure, figure),
            coverage=Ratio(figure, figure, figure),
            efficiency=Ratio(figure, figure, figure),
        )
        for part in parts
        for case in list_cases(part)
        for estimator in ESTIMATORS
        for quantity in ESTIMATED[estimator]
    )
    return StudyResults(Configuration(parts), rows=rows)


@pytest.mark.parametrize(
    ("parts", "figure"),
    [
        ((Part.COVERAGE,), 0.95),
        ((Part.EFFICIENCY,), math.nan),
        ((Part.BIAS,), 0.0),
    ],
)
def test_what_was_found_is_drawn_and_what_was_not_does_no_harm(parts, figure):
    found = draw_figure(make_results(parts, figure))
    assert found["png"].startswith(PNG_SIGNATURE)
    assert ET.fromstring(found["svg"]).tag.endswith("svg")


def test_the_same_results_give_the_same_file():
    results = make_results((Part.EFFICIENCY,), 1.2)
    assert draw_figure(results) == draw_figure(results)


def test_parts_without_campaigns_have_no_figure():
    assert draw_figure(StudyResults(Configuration((Part.SPEED,)))) == {}
