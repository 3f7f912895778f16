"""Results to messages and back, by one rule.

A message has the fields of its result without their units, which its comments give: what leaves
the rig as `contact_time_s` is `contact_time` in a message.
"""

from dataclasses import fields, is_dataclass
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from impact_rig_msgs.msg import (
    FreeDecay,
    HammerEstimate,
    Identification,
    PulseShape,
    SampleEstimate,
    ShapeFit,
    UncertaintyContribution,
)

from impact_rig.results.cross_checks import (
    FreeDecayResults,
    IdentificationResults,
    PulseShapeResults,
    ShapeFitResults,
)
from impact_rig.results.estimates import BudgetLineResults, HammerResults, SampleResults

MESSAGES: dict[type, type] = {
    BudgetLineResults: UncertaintyContribution,
    FreeDecayResults: FreeDecay,
    HammerResults: HammerEstimate,
    IdentificationResults: Identification,
    PulseShapeResults: PulseShape,
    SampleResults: SampleEstimate,
    ShapeFitResults: ShapeFit,
}
"""Results and the messages that carry them."""
UNITS = ("_n_s_per_m", "_n_per_m", "_m_per_s2", "_hz", "_s")
"""How the names of results end, the longest first."""
RENAMED: dict[tuple[type, str], str] = {(SampleResults, "name"): "sample"}
"""Fields that the messages call otherwise."""

Result = TypeVar("Result")


def _find_field(kind: type, name: str) -> str:
    """Return what the messages call a field of a result."""
    plain = next((name.removesuffix(unit) for unit in UNITS if name.endswith(unit)), name)
    return RENAMED.get((kind, name), plain)


_FIELDS: dict[type, tuple[tuple[str, str, Any], ...]] = {
    kind: tuple(
        (field.name, _find_field(kind, field.name), get_type_hints(kind)[field.name])
        for field in fields(kind)
    )
    for kind in MESSAGES
}
"""Name in the result, name in the message, and type of each field."""


def result_to_msg(result: Any) -> Any:
    """Return a result as the message that carries it."""
    message = MESSAGES[type(result)]()
    for name, field, _ in _FIELDS[type(result)]:
        setattr(message, field, _value_to_msg(getattr(result, name)))
    return message


def _value_to_msg(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_value_to_msg(item) for item in value]
    return result_to_msg(value) if is_dataclass(value) else value


def result_from_msg(kind: type[Result], message: Any) -> Result:
    """Return the result of a `kind` that a message carries."""
    return kind(
        **{
            name: _value_from_msg(hint, getattr(message, field))
            for name, field, hint in _FIELDS[kind]
        }
    )


def _value_from_msg(hint: Any, value: Any) -> Any:
    if get_origin(hint) is tuple:
        item = get_args(hint)[0]
        return tuple(_value_from_msg(item, each) for each in value)
    return result_from_msg(hint, value) if hint in MESSAGES else value
