"""A report's results as data: a Digital Calibration Certificate (DCC) in XML, and JSON.

The XML is built after PTB's schema, version 3.2.1, with values as the Digital SI (D-SI) writes
them. The schema comes under the LGPL and is not part of this package: nothing validates by it.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from impact_rig import __version__
from impact_rig.configuration.particulars import Particulars
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.quantity import Comparable, Quantity
from impact_rig.present.printed import list_items
from impact_rig.present.report.page import get_template
from impact_rig.present.report.report import PAPER, TITLE
from impact_rig.present.report.setup import find_test_days
from impact_rig.results.numbers import SAMPLE_MEASURANDS
from impact_rig.results.traces import ReportedCampaign

DCC, SI = "https://ptb.de/dcc", "https://ptb.de/si"
TEMPLATE = "certificate.xml.jinja"
UNITS = {
    "": r"\one", "s": r"\second", "Hz": r"\hertz", "m": r"\metre", "kg": r"\kilogram",
    "m/s": r"\metre\second\tothe{-1}", "N": r"\newton", "J": r"\joule", "N s": r"\newton\second",
    "N/m": r"\newton\metre\tothe{-1}", "N s/m": r"\newton\second\metre\tothe{-1}",
}  # fmt: skip
"""Units as the D-SI writes them; a quantity in another one, as N/m^n, stands in the JSON alone."""
MAIN_METHOD = "the report's method"
PROBABILITY = 0.95  # of each interval
ADDITIONAL = ("contact_law", "free_decay", "checks")
"""Further methods, fields of a sample's estimate."""


@dataclass(frozen=True)
class StatedResult(Comparable):
    """One quantity of a sample as data, in its SI unit."""

    identifier: str  # unique in the report, a name that XML allows
    sample: str
    quantity: str  # in words
    symbol: str
    unit: str  # SI unit; empty: none
    value: Quantity  # with U, effective degrees of freedom, ends of the interval, budget
    coverage_factor: float  # k; NaN: the uncertainty is not determined
    method: str
    is_result: bool  # the value that the report states; else it is additional

    @property
    def interval(self) -> str:
        """How it is told: `even`, by U and k; `uneven`, by its ends; empty: it is not known."""
        if not math.isfinite(self.coverage_factor):
            return ""
        uneven = "uneven" * math.isfinite(self.value.upper)
        return "even" if self.value.is_even else uneven


def list_results(runs: Sequence[ReportedCampaign]) -> list[StatedResult]:
    """Return the results of a report, of each sample those of the first table first."""
    return [
        result
        for number, run in enumerate(runs, start=1)
        for place, sample in enumerate(run.campaign.results.samples, start=1)
        for result in _list_of_sample(f"run{number}.sample{place}", sample)
    ]


def _list_of_sample(place: str, sample: SampleEstimate) -> Iterator[StatedResult]:
    paper = list_items(sample.paper)
    items = {item.field: paper[item.field] for item in SAMPLE_MEASURANDS}
    yield from _state(place, sample.name, items, MAIN_METHOD, is_result=True)
    for name in ADDITIONAL:
        items, method = list_items(getattr(sample, name)), name.replace("_", " ")
        yield from _state(f"{place}.{name}", sample.name, items, method, is_result=False)


def _state(
    place: str, sample: str, items: Mapping[str, Any], method: str, *, is_result: bool
) -> Iterator[StatedResult]:
    """Yield the quantities of a method that are determined."""
    for name, (found, said) in items.items():
        if isinstance(found, Quantity) and found.is_known:
            factor = found.expanded / found.standard if found.standard > 0.0 else math.nan
            words = said.label or name.replace("_", " ")
            named = f"{place}.{name}", sample, words, said.symbol, said.unit
            yield StatedResult(*named, found, factor, method, is_result)


def make_certificate(runs: Sequence[ReportedCampaign], stated: Particulars) -> str:
    """Return the results of a report as a DCC.

    Raises
    ------
    ParameterError
        If nothing says when the tests were: a certificate needs their days.
    """
    tested = stated.get("report", "tested")
    days = [day or tested for day in find_test_days(runs[0].provenance)]
    if not all(days):
        raise ParameterError(
            "a certificate in XML needs the day of the tests: state tested in [report]"
        )
    return get_template(TEMPLATE).render(
        stated=stated,
        days=days,
        run_name=runs[0].name,
        bodies=list_bodies(runs),
        results=[item for item in list_results(runs) if item.unit in UNITS],
        units=UNITS, probability=PROBABILITY, title=TITLE, paper=PAPER,
        version=__version__, dcc=DCC, si=SI,
    )  # fmt: skip


def list_bodies(runs: Sequence[ReportedCampaign]) -> list[str]:
    """Return the bodies that were struck, each once."""
    bodies = [
        run.campaign.results.setup.samples.find(sample.name).body
        for run in runs
        for sample in run.campaign.results.samples
    ]
    return [*dict.fromkeys(bodies)]
