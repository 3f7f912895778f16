"""A report's results as data: a Digital Calibration Certificate (DCC) in XML, and JSON.

The XML is built after PTB's schema, version 3.2.1, with values as the Digital SI (D-SI) writes
them. The schema comes under the LGPL and is not part of this package: nothing validates by it.
"""

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from impact_rig import __version__
from impact_rig.configuration.particulars import OF_SAMPLE, Particulars
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.quantity import Comparable, Quantity
from impact_rig.present.printed import list_items
from impact_rig.present.report.report import PAPER, TITLE
from impact_rig.present.report.setup import find_test_days
from impact_rig.results.numbers import SAMPLE_MEASURANDS
from impact_rig.results.traces import ReportedCampaign

DCC, SI = "https://ptb.de/dcc", "https://ptb.de/si"
VERSION = "3.2.1"
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
NOT_STATED = "not stated"
UNKNOWN_COUNTRY = "XX"
"""Code that ISO 3166-1 leaves to its users."""


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
    for item in SAMPLE_MEASURANDS:
        items = {item.field: paper[item.field]}
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
    root = ET.Element("dcc:digitalCalibrationCertificate", schemaVersion=VERSION)
    root.attrib |= {"xmlns:dcc": DCC, "xmlns:si": SI}
    authority = stated.get("report", "authorised_by")
    signer: Nodes = [("person", _name(authority)), ("mainSigner", "true")]
    laboratory = stated.get("laboratory", "name"), stated.get("laboratory", "address")
    software: Nodes = [*_name("impact-rig"), ("release", __version__)]
    administrative: Nodes = [
        ("dccSoftware", [("software", software)]),
        ("coreData", _list_core(runs, stated)),
        ("items", [("item", _describe_item(body, stated)) for body in list_bodies(runs)]),
        ("calibrationLaboratory", [("contact", _address(*laboratory))]),
        ("respPersons", [("respPerson", signer)]),
        ("customer", _address(stated.get("report", "customer"), "")),
    ]
    _build(root, [
        ("administrativeData", administrative),
        ("measurementResults", [("measurementResult", _list_results(runs, stated))]),
    ])  # fmt: skip
    ET.indent(root)
    return ET.tostring(root, "unicode", xml_declaration=True) + "\n"


def _list_core(runs: Sequence[ReportedCampaign], stated: Particulars) -> "Nodes":
    first, last = find_test_days(runs[0].provenance)
    tested = stated.get("report", "tested")
    if not (first or tested):
        raise ParameterError(
            "a certificate in XML needs the day of the tests: state tested in [report]"
        )
    replaced = stated.get("report", "replaces")
    amended: Nodes = [("typeOfChange", "substituted"), ("replacedUniqueIdentifier", replaced)]
    return [
        ("countryCodeISO3166_1", stated.get("laboratory", "country") or UNKNOWN_COUNTRY),
        ("usedLangCodeISO639_1", "en"),
        ("mandatoryLangCodeISO639_1", "en"),
        ("uniqueIdentifier", stated.get("report", "number") or runs[0].name),
        ("receiptDate", stated.get("report", "received")),
        ("beginPerformanceDate", first or tested),
        ("endPerformanceDate", last or tested),
        ("performanceLocation", "laboratory"),
        ("issueDate", stated.get("report", "issued")),
        ("reportAmendedSubstituted", amended if replaced else ""),
    ]


def _list_results(runs: Sequence[ReportedCampaign], stated: Particulars) -> "Nodes":
    method = [
        *_name(stated.get("report", "method") or "of the laboratory, without a number"),
        ("norm", "JCGM 100:2008"),
        ("reference", stated.get("report", "reference") or PAPER),
    ]
    results = [item for item in list_results(runs) if item.unit in UNITS]
    told = [
        ("result", [*_name(kind), ("data", list(map(_describe_quantity, found)))])
        for kind, is_result in (("results", True), ("additional values", False))
        if (found := [item for item in results if item.is_result is is_result])
    ]
    return [*_name(TITLE), ("usedMethods", [("usedMethod", method)]), ("results", told)]


def _describe_item(body: str, stated: Particulars) -> "Nodes":
    serial = stated.get(OF_SAMPLE + body, "serial_number")
    named: Nodes = [("issuer", "customer" if serial else "other"), ("value", serial or body)]
    return [*_name(body), ("identifications", [("identification", named)])]


def _describe_quantity(item: StatedResult) -> "Node":
    """Return a value with U and k, or with the ends of an uneven interval, and its freedom."""
    found, factor = item.value, repr(item.coverage_factor)
    probability = ("si:coverageProbability", repr(PROBABILITY))
    interval: Nodes = []
    if math.isfinite(item.coverage_factor) and found.is_even:
        parts = [("si:uncertainty", repr(found.expanded)), ("si:coverageFactor", factor)]
        interval = [("si:expandedUnc", [*parts, probability])]
    elif math.isfinite(item.coverage_factor) and math.isfinite(found.upper):
        ends = [("si:intervalMin", repr(found.lower)), ("si:intervalMax", repr(found.upper))]
        standard = ("si:standardUnc", repr(found.standard))
        interval = [("si:coverageInterval", [standard, *ends, probability])]
    freedom: Nodes = [("data", [("quantity", _value(found.degrees_of_freedom, UNITS[""]))])]
    if math.isinf(found.degrees_of_freedom):
        freedom = [("declaration", [("content", "infinite: type B alone counts")])]
    metadata = [("metaData", [*_name("effective degrees of freedom"), *freedom])]
    return (
        f"quantity {item.identifier}",
        [
            *_name(f"{item.sample}: {item.quantity} {item.symbol}, by {item.method}"),
            *_value(found.value, UNITS[item.unit], interval),
            ("measurementMetaData", "" if math.isnan(found.degrees_of_freedom) else metadata),
        ],
    )


def _value(value: float, unit: str, interval: "Nodes" = ()) -> "Nodes":
    """Return a real number of the D-SI; its digits bring it back bit by bit."""
    return [("si:real", [("si:value", repr(value)), ("si:unit", unit), *interval])]


def list_bodies(runs: Sequence[ReportedCampaign]) -> list[str]:
    """Return the bodies that were struck, each once."""
    bodies = [
        run.campaign.results.setup.samples.find(sample.name).body
        for run in runs
        for sample in run.campaign.results.samples
    ]
    return [*dict.fromkeys(bodies)]


Node = tuple[str, "str | Nodes"]
"""An element: its tag, with an identifier behind a blank, and text or further elements."""
Nodes = Sequence[Node]


def _build(parent: ET.Element, nodes: Nodes) -> None:
    """Add elements; one without text or elements is left out."""
    for tag, content in nodes:
        if content:
            name, _, identifier = tag.partition(" ")
            element = ET.SubElement(parent, name if ":" in name else f"dcc:{name}")
            if identifier:
                element.set("id", identifier)
            if isinstance(content, str):
                element.text = _clean(content)
            else:
                _build(element, content)


def _name(text: str) -> Nodes:
    return [("name", [("content", text or NOT_STATED)])]


def _address(name: str, address: str) -> Nodes:
    return [*_name(name), ("location", [("further", [("content", address or NOT_STATED)])])]


def _clean(text: str) -> str:
    """Return a text with single blanks, without letters that XML does not allow."""
    return re.sub(r"[^\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "", " ".join(text.split()))
