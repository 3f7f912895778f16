"""Numbers that cannot be meant are refused with a sentence; what is taken can be shown."""

import copy
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from functools import reduce
from io import StringIO
from operator import getitem
from typing import Any

import pytest
from impact_rig_msgs.msg import Impact
from rich.console import Console

from impact_rig.core.estimates.ringing import FreeDecayEstimate
from impact_rig.core.given.errors import FileError, RigError, UnknownNameError
from impact_rig.core.given.quantity import Quantity
from impact_rig.devices.virtual.choices import Plant
from impact_rig.nodes.messages import make_message
from impact_rig.nodes.result_messages import hit_results_from_msg
from impact_rig.present.rerun.markdown import format_summary
from impact_rig.present.screen import print_full
from impact_rig.recordings.fields import fill_message, from_message
from impact_rig.results.campaign import Results
from impact_rig.results.results_file import check_names, read_results, results_to_json
from impact_rig.results.wire import WireError, format_json, from_json

BY_UNIT = ("_s", "_n_per_m")
"""Endings of names of what is above 0."""
SHOWN = 8
"""Files in which all that is taken is shown."""
SIGNED = (
    "peak_time",
    "shift",
    "spread",
    "_u_",
    "_expanded_",
    "_lower_",
    "_upper_",
    "clock",
    "mass",
)


NEVER_NEGATIVE = {"exponent", "restitution", "residual_percent", "log_decrement", "r_squared"}


@pytest.fixture(scope="module")
def content(strike: Any) -> Any:
    """Return results with a free decay and a contact law, which no plant has both."""
    (ringing, touched) = (
        strike(["aluminium large"], plant=plant) for plant in (Plant.PUBLISHED, Plant.CONTACT)
    )
    sample = replace(ringing.samples[0], contact_law=touched.samples[0].contact_law)
    return json.loads(format_json(results_to_json(replace(ringing, samples=(sample,)))))


def change(content: Any, places: list[tuple[Any, ...]], value: Any) -> Any:
    changed = copy.deepcopy(content)
    for *way, last in places:
        reduce(getitem, way, changed)[last] = value
    return changed


def show(results: Results) -> str:
    """Return everything that is shown of results in words."""
    console = Console(file=StringIO(), width=200)
    print_full(console, results)
    texts = [format_summary(results, sample) for sample in results.samples]
    return console.file.getvalue() + "\n".join(texts)  # type: ignore[attr-defined]


def list_leaves(content: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield where a file has anything but an object: of each list the first item."""
    items = content.items() if isinstance(content, dict) else enumerate(content[:1])
    for key, value in items:
        if isinstance(value, dict | list) and value:
            yield from list_leaves(value, (*place, key))
        yield (*place, key)


@pytest.mark.parametrize(
    "value", [None, "text", [], {}, True, [[[]]], 0.0, -1, 5e-324, 1e300, float("inf")]
)
def test_whatever_stands_in_a_place_of_a_file_is_refused_with_it_or_can_be_shown(content, value):
    taken = []
    for place in list_leaves(content):
        if place[0] in ("format", "remarks", "origin", "origin_source"):
            continue
        try:
            check_names(from_json(Results, change(content, [place], value)))
        except UnknownNameError as error:
            assert repr(value) in str(error)  # noqa: PT017
        except WireError as error:
            assert str(place[-1]) in str(error) or str(place[0]) in str(error)  # noqa: PT017
        else:
            taken.append(place)
    if isinstance(value, float | int) and not isinstance(value, bool):
        fields = [place for place in taken if isinstance(reduce(getitem, place, content), float)]
        names = [str(place[-1]) for place in fields if place[0] != "setup"]
        assert not names or abs(value) <= 1.0
        above = [name for name in names if name.endswith(BY_UNIT) and value <= 0.0]
        assert not [name for name in above if not any(part in name for part in SIGNED)]
        assert value >= 0.0 or not NEVER_NEGATIVE & {*names}
    for place in taken[::SHOWN]:
        shown = show(from_json(Results, change(content, [place], value)))
        assert "inf" not in shown.split(), place
        assert not re.search(r"\d{40}", shown), place


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("damping_ratio", 0.0, "damping_ratio is 0: it must be above 0"),
        ("stiffness", -4e6, r"stiffness is -4e\+06 N/m: it must be above 0"),
        ("frequency", float("inf"), r"frequency is inf Hz: it must be 1e\+12 at most"),
        ("stiffness", 1.2e21, r"stiffness is 1\.2e\+21 N/m: it must be 1e\+15 at most"),
    ],
)
def test_a_message_is_refused_for_the_same_reasons(name, value, told):
    message = fill_message(make_message("FreeDecay"), FreeDecayEstimate(), make_message)
    part = getattr(message, name)
    if isinstance(part, float):
        setattr(message, name, value)
    else:
        fill_message(part, Quantity(value))
    with pytest.raises(RigError, match=told):
        from_message(FreeDecayEstimate, message)


def test_a_verdict_is_refused_for_the_same_reasons():
    with pytest.raises(RigError, match=r"contact_time is -0\.0001 s: it must be above 0"):
        hit_results_from_msg(Impact(contact_time=-1e-4))


@pytest.mark.parametrize(
    ("field", "value", "told"),
    [
        ("damping_ratio", 0.0, r"damping_ratio is 0: it must be above 0"),
        ("stiffness_lower_n_per_m", 1e15, r"stiffness_lower_n_per_m is 1e\+15: it must not be"),
        ("stiffness_upper_n_per_m", -1.0, r"stiffness_upper_n_per_m is -1 N/m: it must be above"),
        ("stiffness_lower_n_per_m", -1.0, r"stiffness_lower_n_per_m is -1 N/m: it must be"),
        ("stiffness_n_per_m", 1.2e21, r"stiffness_n_per_m is 1\.2e\+21 N/m: it must be 1e\+15"),
    ],
)
def test_what_cannot_be_meant_in_a_file_is_named(tmp_path, content, field, value, told):
    place = ("samples", 0, "free_decay", field)
    path = tmp_path / "results.json"
    path.write_text(json.dumps(change(content, [place], value)), "utf-8")
    with pytest.raises(FileError, match=rf"free_decay\.{told}"):
        read_results(path)
