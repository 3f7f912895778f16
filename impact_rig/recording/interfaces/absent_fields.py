"""What stands for the fields that recordings made by older versions do not have.

One place for all who read them: the analysis of a file and the replay through a fresh estimator
must see the same.
"""

import math
from collections.abc import Mapping
from typing import Any

from impact_rig.core.setup.samples import DEFAULT_CLOCK_UNCERTAINTY

_NO_TIME: Mapping[str, int] = {"sec": 0, "nanosec": 0}

ABSENT_FIELDS: Mapping[str, Mapping[str, Any]] = {
    "impact_rig_msgs/msg/Channel": {
        "values": (),  # they hold counts only
        "overload": False,  # told by the counts alone
    },
    "impact_rig_msgs/msg/HammerRelease": {
        "latest_contact": math.nan,  # that of the swing
    },
    "impact_rig_msgs/msg/HammerState": {
        "disarmed_by": 0,
        "holder": "",
    },
    "impact_rig_msgs/msg/AcquisitionState": {
        "simulated": False,
    },
    "impact_rig_msgs/msg/Sample": {
        "mass_uncertainty": 0.0,  # not stated
    },
    "impact_rig_msgs/msg/RigSetup": {
        "hammer_mass_uncertainty": 0.0,
        "hammer_stiffness": math.nan,  # from the control experiment
        "accelerometer_mass_uncertainty": 0.0,
        "clock_uncertainty": DEFAULT_CLOCK_UNCERTAINTY,
        "sensors": (),
    },
    "impact_rig_msgs/msg/Impact": {
        "setup_stamp": _NO_TIME,  # not told
    },
    "impact_rig_msgs/msg/HammerEstimate": {
        "setup_stamp": _NO_TIME,
    },
    "impact_rig_msgs/msg/SampleEstimate": {
        "setup_stamp": _NO_TIME,
        "first_peak": math.nan,  # not told
        "first_peak_time": math.nan,
        "second_peak": math.nan,
        "second_peak_time": math.nan,
    },
    "impact_rig_msgs/msg/ModelComparison": {
        "setup_stamp": _NO_TIME,
        "hammer_peak": math.nan,
        "specimen_peak": math.nan,
    },
    "impact_rig_msgs/msg/AnalysisSettings": {
        "maximum_peak": 1.0,  # hits were judged without these
        "keep_hits": 0,
    },
}
"""Values by type and field, in the types of the messages; a message is a mapping of its fields."""


def read_field(message: Any, type_name: str, field: str) -> Any:
    """Return a field of a decoded message, or what stands for it if the message is older.

    Parameters
    ----------
    message : object
        With its fields as attributes.
    type_name, field : str
        Which field of which type, as in `ABSENT_FIELDS`.
    """
    return getattr(message, field, ABSENT_FIELDS[type_name][field])
