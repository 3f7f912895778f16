"""Reading and setting the properties of the simulated NI-DAQmx, by NI's names of them."""
# ruff: noqa: N802, the methods have the names of NI's calls

from typing import Any

from impact_rig.devices.peers.nidaqmx_device import (
    INPUTS,
    LINES,
    NAME,
    PRODUCT_TYPE,
    SERIAL_NUMBER,
    DaqmxError,
    SimulatedDevice,
)
from impact_rig.devices.peers.nidaqmx_task import SimulatedTask

Fields = dict[str, Any]
"""Of the answer to a call."""


class AttributeService:
    """The calls that read or set one property."""

    def __init__(self, device: SimulatedDevice) -> None:
        self.device = device

    def find_task(self, request: Any) -> SimulatedTask:
        """Return the task that a call is for."""
        try:
            return self.device.tasks[request.task.name]
        except KeyError:
            raise DaqmxError(-200088, "Task specified is invalid or does not exist.") from None

    def GetTaskAttributeString(self, request: Any) -> Fields:
        """Return the task's name, or those of its channels."""
        task = self.find_task(request)
        names = [channel.name for channel in task.inputs]
        return _answer(request, {"NAME": task.name, "CHANNELS": ", ".join(names)})

    def GetTaskAttributeUInt32(self, request: Any) -> Fields:
        """Return the number of channels."""
        task = self.find_task(request)
        return _answer(request, {"NUM_CHANS": len(task.inputs) + bool(task.line)})

    def GetTimingAttributeDouble(self, request: Any) -> Fields:
        """Return the rate that is possible."""
        return _answer(request, {"SAMP_CLK_RATE": self.find_task(request).rate})

    def GetChanAttributeDouble(self, request: Any) -> Fields:
        """Return the upper end of a channel's range."""
        channels = {channel.name: channel for channel in self.find_task(request).inputs}
        return _answer(request, {"AI_RNG_HIGH": channels[request.channel].limit})

    def SetChanAttributeInt32(self, request: Any) -> Fields:
        """Take the coupling, which makes no difference here."""
        return _answer(request, {"AI_COUPLING": None}) and {}

    def GetReadAttributeBool(self, request: Any) -> Fields:
        """Return whether a channel was overloaded."""
        known = {"OVERLOADED_CHANS_EXIST": bool(self.find_task(request).list_overloaded())}
        return _answer(request, known if self.device.has_overload_detection else {})

    def GetReadAttributeString(self, request: Any) -> Fields:
        """Return which channels were."""
        return _answer(
            request, {"OVERLOADED_CHANS": ", ".join(self.find_task(request).list_overloaded())}
        )

    def GetReadAttributeUInt64(self, request: Any) -> Fields:
        """Return the position of the next read."""
        return _answer(request, {"CURR_READ_POS": self.find_task(request).position})

    def SetReadAttributeInt32(self, request: Any) -> Fields:
        """Take where reads begin, and whether unread samples are overwritten."""
        names = {"RELATIVE_TO": "relative_to", "OFFSET": "offset", "OVERWRITE": "overwrite"}
        name = _answer(request, names)["value"]
        setattr(self.find_task(request), name, getattr(request, request.WhichOneof("value_enum")))
        return {}

    def GetSystemInfoAttributeString(self, request: Any) -> Fields:
        """Return the names of the devices."""
        return _answer(request, {"DEV_NAMES": NAME if self.device.is_present else ""})

    def GetDeviceAttributeString(self, request: Any) -> Fields:
        """Return the product's name, or those of inputs and lines."""
        self._check_device(request.device_name)
        values = {
            "PRODUCT_TYPE": PRODUCT_TYPE,
            "AI_PHYSICAL_CHANS": ", ".join(INPUTS),
            "DO_LINES": ", ".join(LINES),
        }
        return _answer(request, values)

    def GetDeviceAttributeUInt32(self, request: Any) -> Fields:
        """Return the serial number."""
        self._check_device(request.device_name)
        return _answer(request, {"SERIAL_NUM": SERIAL_NUMBER})

    def GetDeviceAttributeBool(self, request: Any) -> Fields:
        """Return whether it is simulated, and samples both inputs at once."""
        self._check_device(request.device_name)
        return _answer(
            request,
            {
                "IS_SIMULATED": True,
                "AI_SIMULTANEOUS_SAMPLING_SUPPORTED": self.device.samples_at_once,
            },
        )

    def _check_device(self, name: str) -> None:
        if name != NAME or not self.device.is_present:
            raise DaqmxError(-200220, f"Device identifier is invalid.\n\nDevice Specified: {name}")


def _answer(request: Any, values: Fields) -> Fields:
    """Return the value of the attribute that is asked for, by NI's name of it."""
    number = getattr(request, request.WhichOneof("attribute_enum"))
    known = request.DESCRIPTOR.fields_by_name["attribute"].enum_type.values_by_number
    name = known[number].name.partition("_ATTRIBUTE_")[2] if number in known else f"{number:#x}"
    if name not in values:
        raise DaqmxError(
            -200452,
            "Specified property is not supported by the device or is not applicable to the"
            f" task.\n\nProperty: {name}",
        )
    return {"value": values[name]}
