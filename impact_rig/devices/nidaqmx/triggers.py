"""The reference trigger: what the record is cut around."""

from typing import TYPE_CHECKING

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.devices.acceleration_source import AcquisitionPlan
from impact_rig.devices.nidaqmx.errors import report_errors
from impact_rig.devices.nidaqmx.inputs import Input

if TYPE_CHECKING:
    from nidaqmx import Task

ANALOG = "analog"
"""The trigger is the hammer's own signal; else a terminal."""
EITHER = "either"
EDGES = (EITHER, "rising", "falling")


class Trigger:
    """What the rig file says of it.

    Parameters
    ----------
    options : TomlTable
        trigger: "analog" or a terminal; edge: of the acceleration, or of the terminal's voltage.

    Raises
    ------
    ParameterError
        If a value is none of these.
    """

    def __init__(self, options: TomlTable) -> None:
        self._options = options
        self._source = options.take_text("trigger", ANALOG)
        is_analog = self._source == ANALOG
        if not is_analog and not self._source.startswith("/"):
            raise options.refuse("trigger", "analog, or a terminal like /Dev1/PFI0")
        edges = EDGES if is_analog else EDGES[1:]
        self._edge = options.take_choice("edge", edges, edges[0])

    def set_up(self, task: "Task", plan: AcquisitionPlan, hammer: Input) -> None:
        """Tell the task.

        Raises
        ------
        ParameterError
            If the device cannot trigger so.
        """
        with report_errors(f"trigger {self._source}", self._options, "trigger"):
            if self._source == ANALOG:
                self._set_up_analog(task, plan, hammer)
            else:
                self._set_up_terminal(task, plan)

    def _set_up_analog(self, task: "Task", plan: AcquisitionPlan, hammer: Input) -> None:
        from nidaqmx.constants import Slope, WindowTriggerCondition1

        if plan.trigger_level >= hammer.full_scale:
            raise self._options.make_error(
                "trigger_level",
                f"trigger_level of {self._options.place} is {plan.trigger_level:g} m/s^2: the"
                f" hammer's channel shows {hammer.full_scale:g} m/s^2 at most",
            )
        level = plan.trigger_level / abs(hammer.scale)
        trigger = task.triggers.reference_trigger
        if self._edge == EITHER:
            trigger.cfg_anlg_window_ref_trig(
                hammer.name, level, -level, plan.pre_trigger_points,
                WindowTriggerCondition1.LEAVING_WINDOW,
            )  # fmt: skip
            return
        # A sensor that looks the other way falls where the acceleration rises.
        is_rising = (self._edge == "rising") == (hammer.scale > 0.0)
        trigger.cfg_anlg_edge_ref_trig(
            hammer.name,
            plan.pre_trigger_points,
            Slope.RISING if is_rising else Slope.FALLING,
            level if is_rising else -level,
        )

    def _set_up_terminal(self, task: "Task", plan: AcquisitionPlan) -> None:
        from nidaqmx.constants import Edge

        task.triggers.reference_trigger.cfg_dig_edge_ref_trig(
            self._source, plan.pre_trigger_points, Edge[self._edge.upper()]
        )
