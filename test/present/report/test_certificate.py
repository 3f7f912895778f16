"""The results of a report as data, read by a program that is not ours."""

import json
import math
import sys
import types
import xml.etree.ElementTree as ET
from dataclasses import replace

import pytest

from impact_rig.configuration.particulars import Particulars
from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.quantity import Quantity
from impact_rig.present.report import certificate
from impact_rig.present.report.certificate import list_results, make_certificate
from impact_rig.results.traces import TracedCampaign
from impact_rig.results.wire import to_json

from .conftest import HOSTILE, STATED

NAMES = {"dcc": certificate.DCC, "si": certificate.SI}


@pytest.fixture(scope="module")
def reader():
    """Return pydcc's reader; what checks signatures and loads from the net is left out.

    Its library of 2018 does not load beside today's OpenSSL.
    """
    others = {
        "signxml": ("InvalidCertificate", "InvalidSignature", "InvalidInput"),
        "signxml.xades": ("XAdESVerifier",),
        "certvalidator": ("CertificateValidator", "errors", "ValidationContext"),
        "asn1crypto": ("pem",), "cryptography": ("x509",), "requests": (), "xmlschema": (),
        "pydantic": ("BaseModel", "ValidationError"),
    }  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        for name, parts in others.items():
            module = types.ModuleType(name)
            for part in parts:
                setattr(module, part, type(part, (), {}))
            patch.setitem(sys.modules, name, module)
        module = types.ModuleType("dcc.dcc_xml_validator")
        module.DCCXMLValidator = type("DCCXMLValidator", (), {})
        patch.setitem(sys.modules, module.__name__, module)
        reason = "pip install --no-deps pydcc==0.2.33"
        return pytest.importorskip("dcc.dcc", reason=reason).DCC


def read(text):
    return ET.fromstring(text.encode())


def test_another_reader_finds_each_value_with_its_unit_and_uncertainty(reader, told):
    text = make_certificate([told], STATED)
    found = reader(byte_array=text.encode())
    assert (found.uid(), found.version(), found.mandatory_language()) == (
        '4711"; }', "3.2.1", "en",
    )  # fmt: skip
    assert found.calibration_laboratory_name() == "Lab <7>"
    assert f"{found.calibration_date():%Y-%m-%d}" == "2023-11-14"
    values = [value["real"] for _, value in found.get_calibration_results("name")]
    results = [item for item in list_results([told]) if item.unit in certificate.UNITS]
    results.sort(key=lambda item: not item.is_result)
    assert len(values) == len(results) > 12
    intervals = 0
    for value, item in zip(values, results, strict=True):
        assert float(value["value"]) == item.value.value, item.identifier
        assert value["unit"] == certificate.UNITS[item.unit]
        if "expandedUnc" in value:
            told_of = value["expandedUnc"]
            assert float(told_of["uncertainty"]) == item.value.expanded
            assert float(told_of["coverageFactor"]) == item.coverage_factor
            assert float(told_of["coverageProbability"]) == 0.95
            intervals += 1
    assert intervals > 6


def test_the_results_are_those_of_the_estimates(told):
    results = {item.identifier: item for item in list_results([told])}
    (first, second) = told.campaign.results.samples
    found = results["run1.sample1.stiffness"]
    stated = first.paper.stiffness
    assert (found.sample, found.symbol, found.unit) == (HOSTILE, "k", "N/m")
    assert found.value == stated
    assert found.coverage_factor * stated.standard == pytest.approx(stated.expanded)
    assert results["run1.sample2.contact_time"].value == second.paper.contact_time
    assert [item.is_result for item in results.values()].count(True) == 6
    json.dumps([to_json(item) for item in results.values()], allow_nan=False)


@pytest.mark.parametrize(
    ("quantity", "tags"),
    [
        (Quantity(2e-4, 1e-6, 2e-6, degrees_of_freedom=7.5), {"expandedUnc"}),
        (Quantity(2e-4, 1e-6, 2e-6, 1.9e-4, 2.5e-4, math.inf), {"coverageInterval"}),
        (Quantity(2e-4), set()),
    ],
    ids=["even", "uneven", "without"],
)
def test_an_interval_is_written_as_it_is(told, quantity, tags):
    results = told.campaign.results
    paper = replace(results.samples[0].paper, contact_time=quantity)
    samples = (replace(results.samples[0], paper=paper),)
    run = replace(told, campaign=TracedCampaign(replace(results, samples=samples)))
    root = read(make_certificate([run], STATED))
    (item,) = [it for it in root.iter() if it.get("id") == "run1.sample1.contact_time"]
    real = item.find("si:real", NAMES)
    assert {child.tag.partition("}")[2] for child in real} - {"value", "unit"} == tags
    if "coverageInterval" in tags:
        ends = [real.findtext(f".//si:{it}", None, NAMES) for it in ("intervalMin", "intervalMax")]
        assert list(map(float, ends)) == [1.9e-4, 2.5e-4]
        assert "infinite" in "".join(item.itertext())
    elif tags:
        assert item.findtext(".//dcc:metaData//si:value", None, NAMES) == "7.5"


def test_its_parts_stand_in_the_order_that_the_schema_asks_for(told):
    stated = Particulars({**STATED.texts, "report": {
        **STATED.texts["report"], "received": "2023-11-01",
        "method": "LP-12", "issued": "2023-12-01",
    }})  # fmt: skip
    root = read(make_certificate([told], stated))

    def list_tags(path):
        return [child.tag.partition("}")[2] for child in root.find(path, NAMES)]

    assert list_tags("dcc:administrativeData") == [
        "dccSoftware", "coreData", "items", "calibrationLaboratory", "respPersons", "customer",
    ]  # fmt: skip
    assert list_tags(".//dcc:coreData") == [
        "countryCodeISO3166_1", "usedLangCodeISO639_1", "mandatoryLangCodeISO639_1",
        "uniqueIdentifier", "receiptDate", "beginPerformanceDate", "endPerformanceDate",
        "performanceLocation", "issueDate", "reportAmendedSubstituted",
    ]  # fmt: skip
    assert list_tags(".//dcc:measurementResult") == [
        "name", "usedMethods", "results",
    ]  # fmt: skip
    assert root.findtext(".//dcc:countryCodeISO3166_1", None, NAMES) == "XX"
    ids = [item.get("id") for item in root.iter() if item.get("id")]
    assert len(ids) == len(set(ids))


def test_without_a_day_of_the_tests_there_is_no_certificate(told):
    undated = replace(told, provenance=None)
    with pytest.raises(ParameterError, match="needs the day of the tests: state tested in"):
        make_certificate([undated], STATED)
    stated = STATED.set(["report.tested=2023-11-14"])
    assert "2023-11-14" in make_certificate([undated], stated)
