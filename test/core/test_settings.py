"""Settings of the analysis: what is refused."""

import math

import pytest

from impact_rig.core.errors import ParameterError
from impact_rig.core.setup import AnalysisSettings


@pytest.mark.parametrize(
    ("field", "value", "right"),
    [
        ("cutoff_frequency", -1.0, "0 or more"),
        ("cutoff_frequency", math.nan, "0 or more"),
        ("pulse_factor", 0.5, "between 1 and 4"),
        ("pre_trigger", 0.0, "above zero"),
        ("record_duration", -2e-3, "above zero"),
        ("pre_trigger", 2e-3, "shorter than the record of 0.002 s"),
        ("detection_level", 0.0, "between 1e-06 and 1"),
        ("minimum_peak", 1.5, "between 0 and 1"),
        ("maximum_peak", 1.5, "between 0 and 1"),
        ("maximum_peak", 0.15, "above the minimum_peak of 0.15"),
        ("overload_run", 0, "between 1 and 1000"),
        ("keep_hits", -1, "between 0 and 1e+06"),
        ("keep_hits", 2.5, "must be whole"),
        ("double_hit_level", 0.0, "between 0.001 and 1"),
    ],
)
def test_what_cannot_be_meant_is_refused_by_name(field, value, right):
    with pytest.raises(ParameterError) as error:
        AnalysisSettings(**{field: value})
    message = str(error.value)
    assert field in message
    assert str(value) in message
    assert right in message
