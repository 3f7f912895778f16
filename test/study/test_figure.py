"""The figure is drawn from whatever was found, the same each time."""

import math
import xml.etree.ElementTree as ET
from dataclasses import replace

from impact_rig.study.campaigns import ESTIMATED
from impact_rig.study.cases import ESTIMATORS, Configuration, Part, list_cases
from impact_rig.study.files import draw_figure
from impact_rig.study.results import SYMBOLS, Bias, Ratio, Row, StudyResults

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def make_results(parts, figure):
    rows = tuple(
        Row(
            part=part,
            axis=case.axis,
            value=case.value,
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


def test_what_was_not_determined_does_no_harm_and_is_drawn_the_same_each_time():
    undetermined = make_results((Part.COVERAGE, Part.EFFICIENCY), math.nan)
    drawn = draw_figure(undetermined)
    assert drawn["png"].startswith(PNG_SIGNATURE)
    assert drawn == draw_figure(undetermined)


def test_each_axis_of_the_bias_has_its_column_of_quantities():
    results = make_results((Part.BIAS,), 0.0)
    two = tuple(row for row in results.rows if row.axis in ("bits", "noise"))
    image = ET.fromstring(draw_figure(replace(results, rows=two))["svg"])
    panels = [item for item in image.iter() if item.get("id", "").startswith("axes_")]
    assert len(panels) == 2 * len(SYMBOLS)


def test_parts_without_campaigns_have_no_figure():
    assert draw_figure(StudyResults(Configuration((Part.SELECTION,)))) == {}
