"""What the simulated NI-DAQmx does when it is called: the calls that the drivers need.

Each method is named as the call of NI's service `nidaqmx_grpc.NiDAQmx`; it takes the request and
returns the fields of the answer.
"""
# ruff: noqa: N802, the methods have the names of NI's calls

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from impact_rig.devices.peers.nidaqmx_attributes import AttributeService, Fields
from impact_rig.devices.peers.nidaqmx_device import (
    EXCITATIONS,
    INPUTS,
    LINES,
    RANGES,
    DaqmxError,
    Input,
)
from impact_rig.devices.peers.nidaqmx_task import FINITE, SimulatedTask, Trigger

STANDARD_GRAVITY = 9.80665
"""[m/s^2]"""
POUND = 4.4482216152605
"""[N]"""
METERS_PER_SECOND_SQUARED = 12470
NEWTONS = 15875
RISING, LEAVING_WINDOW, VOLTS = 10280, 10208, 10348
STOP, COMMIT, ABORT = 1, 3, 6
"""NI's numbers of units, trigger conditions and actions."""
ACCELERATION_SENSITIVITIES = {12509: 1e-3 / STANDARD_GRAVITY, 12510: 1.0 / STANDARD_GRAVITY}
FORCE_SENSITIVITIES = {15891: 1e-3, 15892: 1e-3 / POUND}
"""Voltage for 1 m/s^2 or 1 N of NI's units of sensitivity [V]."""


class DaqmxService(AttributeService):
    """NI-DAQmx with one device."""

    def CreateTask(self, request: Any) -> Fields:
        """Begin a session, or attach to one that a lost connection left behind."""
        name = request.session_name or f"_unnamedTask<{time.monotonic_ns():X}>"
        is_known = name in self.device.tasks
        if not is_known:
            self.device.tasks[name] = SimulatedTask(name, self.device)
        return {"task": {"name": name}, "new_session_initialized": not is_known}

    def ClearTask(self, request: Any) -> Fields:
        """End a session."""
        self.device.drop(self.find_task(request))
        return {}

    def CreateAIAccelChan(self, request: Any) -> Fields:
        """Add an accelerometer."""
        unit = ACCELERATION_SENSITIVITIES[request.sensitivity_units_raw]
        _require("AI.Accel.Units", request.units_raw, (METERS_PER_SECOND_SQUARED,))
        return self._add_sensor(request, request.sensitivity * unit)

    def CreateAIForceIEPEChan(self, request: Any) -> Fields:
        """Add a force sensor."""
        unit = FORCE_SENSITIVITIES[request.sensitivity_units_raw]
        _require("AI.Force.Units", request.units_raw, (NEWTONS,))
        return self._add_sensor(request, request.sensitivity * unit)

    def CreateAIVoltageChan(self, request: Any) -> Fields:
        """Add a voltage."""
        _require("AI.Voltage.Units", request.units_raw, (VOLTS,))
        return self._add_input(request, 1.0)

    def CreateDOChan(self, request: Any) -> Fields:
        """Add an output line."""
        if request.lines not in LINES:
            raise _make_unknown(request.lines)
        self.find_task(request).line = request.lines
        return {}

    def CfgSampClkTiming(self, request: Any) -> Fields:
        """Set rate and length."""
        task = self.find_task(request)
        task.set_clock(request.rate, request.sample_mode_raw, request.samps_per_chan)
        return {}

    def CfgAnlgEdgeRefTrig(self, request: Any) -> Fields:
        """Trigger where a channel crosses a level one way."""
        level, sign = request.trigger_level, 1 if request.trigger_slope_raw == RISING else -1
        return self._set_trigger(request, lambda numbers: sign * numbers >= sign * level)

    def CfgAnlgWindowRefTrig(self, request: Any) -> Fields:
        """Trigger where a channel leaves a window."""
        _require("RefTrig.AnlgWin.TrigWhen", request.trigger_when_raw, (LEAVING_WINDOW,))
        low, high = request.window_bottom, request.window_top
        return self._set_trigger(request, lambda numbers: (numbers > high) | (numbers < low))

    def CfgDigEdgeRefTrig(self, request: Any) -> Fields:
        """Trigger by a terminal: here nothing is connected to it."""
        return self._set_trigger(request, lambda numbers: np.zeros(numbers.shape, dtype=bool))

    def TaskControl(self, request: Any) -> Fields:
        """Reserve what the task needs, or stop it."""
        task = self.find_task(request)
        if request.action_raw == COMMIT:
            task.reserve()
        elif request.action_raw in {STOP, ABORT}:
            task.stop()
        return {}

    def StartTask(self, request: Any) -> Fields:
        """Start the sample clock."""
        self._find_usable(request).start()
        return {}

    def StopTask(self, request: Any) -> Fields:
        """Stop it."""
        self._find_usable(request).stop()
        return {}

    def WaitUntilTaskDone(self, request: Any) -> Fields:
        """Wait for the end of a finite acquisition."""
        task = self.find_task(request)
        if not self._wait(task, request.time_to_wait, task.is_done):
            raise DaqmxError(
                -200560,
                "Wait Until Done did not indicate that the task was done within the specified"
                f" timeout.\n\nTask Name: {task.name}",
            )
        return {}

    def ReadAnalogF64(self, request: Any) -> Fields:
        """Read samples, grouped by channel; too few are told in the answer's status."""
        task = self._find_usable(request)
        found: list[Any] = []

        def read() -> bool:
            found[:] = [task.read(request.num_samps_per_chan, is_late=False)]
            return found[0] is not None

        if not self._wait(task, request.timeout, read):
            found[:] = [task.read(request.num_samps_per_chan, is_late=True)]
        status, samples = found[0]
        return {
            "status": status,
            "read_array": samples.ravel(),
            "samps_per_chan_read": samples.shape[1],
        }

    def WriteDigitalLines(self, request: Any) -> Fields:
        """Drive the task's line."""
        task = self._find_usable(request)
        task.reserve()
        self.device.set_level(task.line, level=bool(request.write_array[0]))
        return {"samps_per_chan_written": 1}

    def ReadDigitalLines(self, request: Any) -> Fields:
        """Read the task's line back."""
        level = self.device.levels.get(self._find_usable(request).line, False)
        return {"read_array": bytes([level]), "samps_per_chan_read": 1, "num_bytes_per_samp": 1}

    def _find_usable(self, request: Any) -> SimulatedTask:
        task = self.find_task(request)
        task.check_usable()
        return task

    def _wait(self, task: SimulatedTask, timeout: float, is_ready: Callable[[], bool]) -> bool:
        """Wait until something is so; False: it did not come in time."""
        deadline = time.monotonic() + timeout
        while True:
            task.check_usable()
            if is_ready():
                return True
            now = time.monotonic()
            if now >= deadline:
                return False
            pause = 1e-3 if task.mode != FINITE else task.find_end() - now
            self.device.changed.wait(max(1e-4, min(deadline - now, pause, 1.0)))

    def _add_sensor(self, request: Any, volts: float) -> Fields:
        _require("AI.Excit.Val", request.current_excit_val, EXCITATIONS)
        return self._add_input(request, 1.0 / volts)

    def _add_input(self, request: Any, units_per_volt: float) -> Fields:
        if request.physical_channel not in INPUTS:
            raise _make_unknown(request.physical_channel)
        wanted = max(abs(request.min_val), abs(request.max_val)) / units_per_volt
        # A part in a billion beyond a range is rounding.
        fitting = [limit for limit in RANGES if limit >= wanted * (1 - 1e-9)]
        if not fitting:
            raise _make_refusal("AI.Max", request.max_val, f"{RANGES[-1] * units_per_volt}")
        name = request.name_to_assign_to_channel or request.physical_channel
        self.find_task(request).inputs.append(
            Input(name, request.physical_channel, units_per_volt, fitting[0])
        )
        return {}

    def _set_trigger(self, request: Any, is_beyond: Callable[[Any], Any]) -> Fields:
        task = self.find_task(request)
        task.trigger = Trigger(request.trigger_source, request.pretrigger_samples, is_beyond)
        return {}


def _require(what: str, value: Any, known: tuple[Any, ...]) -> None:
    if value not in known:
        raise _make_refusal(what, value, ", ".join(str(item) for item in known))


def _make_refusal(what: str, value: Any, possible: str) -> DaqmxError:
    return DaqmxError(
        -200077,
        "Requested value is not a supported value for this property. The property value may be"
        f" invalid because it conflicts with another property.\n\nProperty: {what}\n"
        f"Requested Value: {value}\nYou Can Select: {possible}",
    )


def _make_unknown(name: str) -> DaqmxError:
    return DaqmxError(
        -200170,
        "Physical channel specified does not exist on this device.\n\nRefer to the documentation"
        f" for channels available on this device.\n\nPhysical Channel Name: {name}",
    )
