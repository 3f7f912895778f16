"""The accelerometers: armed for one hit at a time, they stream it as blocks."""

import functools
from dataclasses import replace
from typing import Any

from impact_rig_msgs.msg import AcquisitionState, HammerRelease, RigSetup
from impact_rig_msgs.srv import Arm
from std_srvs.srv import Trigger

from impact_rig.core.errors import DeviceError, RigError
from impact_rig.core.model.pulses import PULSE_SHAPES
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.choices import Fault, Plant
from impact_rig.devices.virtual.digitizer import DigitizerSettings
from impact_rig.devices.virtual.faults import (
    FaultPlan,
    faults_from_names,
    scheduled_fault_from_text,
)
from impact_rig.devices.virtual.plants import pulse_shape_from_name
from impact_rig.devices.virtual.rig import VirtualHit, VirtualRig, VirtualRigSettings
from impact_rig.nodes import interfaces, messages
from impact_rig.nodes.process import run_node
from impact_rig.nodes.rig_node import RigNode, split_names
from impact_rig.recording.interfaces.messages import setup_from_msg

CONNECTION_TIMEOUT = 10.0
"""How long arming may wait for estimator and recorder to connect [s], our choice."""


class AccelerometerNode(RigNode):
    """Streams what the virtual rig's accelerometers see after each release."""

    def __init__(self, **options: Any) -> None:
        super().__init__("accelerometer", **options)
        self._declare_stream()
        self._declare_virtual_rig()
        self._rig_settings = VirtualRigSettings()
        self._rig: VirtualRig | None = None
        self._label: HitLabel | None = None
        self._struck = False
        self._record = 0
        self._blocks_sent = 0
        self._publish_state = functools.partial(
            self.advertise_state(interfaces.ACQUISITION_STATE), source=interfaces.VIRTUAL_SOURCE
        )
        self._acceleration = self.advertise(interfaces.ACCELERATION)
        self._virtual_impact = self.advertise(interfaces.VIRTUAL_IMPACT)
        self.listen(interfaces.SETUP, self._take_setup)
        self.listen(interfaces.RELEASE, self._swing)
        self.create_service(
            Arm, interfaces.ARM_ACCELEROMETER, self._arm, callback_group=self.waiting_group
        )
        self.create_service(Trigger, interfaces.DISARM_ACCELEROMETER, self._disarm)

    def _declare_stream(self) -> None:
        self.declare("block_size", 1000, "points per block [-]", low=1, high=10_000_000)
        self.declare(
            "required_subscribers", "estimator, recorder",
            "nodes of this namespace, by commas, that must be connected to `acceleration` before"
            " a release",
        )  # fmt: skip
        self.declare(
            "trigger_timeout", 0.5, "how long after the expected contact a trigger may come [s]",
            low=0.0, high=60.0,
        )  # fmt: skip

    def _declare_virtual_rig(self) -> None:
        rig, digitizer = VirtualRigSettings(), DigitizerSettings()
        plants = ", ".join(plant.value for plant in Plant)
        shapes = ", ".join(shape.name for shape in PULSE_SHAPES)
        faults = ", ".join(fault.value for fault in Fault)
        self.declare("plant", rig.plant.value, f"physics of the virtual rig: {plants}")
        self.declare("seed", rig.seed, "the same seed gives the same hits [-]", low=0, high=2**62)
        self.declare("contact_time_scatter", rig.contact_time_scatter,
                     "standard deviation of tau_p from hit to hit, relative [-]",
                     low=0.0, high=0.2)  # fmt: skip
        self.declare("amplitude_scatter", rig.amplitude_scatter,
                     "standard deviation of the force from hit to hit, relative [-]",
                     low=0.0, high=0.2)  # fmt: skip
        self.declare("pulse_shape", rig.pulse_shape.name, f"of the contact force: {shapes}")
        self.declare("asymmetry", rig.asymmetry,
                     "rise of the pulse over its fall, as a part of its length [-]",
                     low=-0.5, high=0.5)  # fmt: skip
        self.declare("hammer_damping", rig.hammer_damping, "c1 of the virtual hammer [N s/m]",
                     low=0.0, high=1e9)  # fmt: skip
        self.declare("fault_probability", 0.0, "of each fault, drawn for each hit [-]",
                     low=0.0, high=1.0)  # fmt: skip
        self.declare("faults", "", f"those drawn, by commas; empty: all of {faults}")
        self.declare(
            "scheduled_faults", "",
            "IMPACT:FAULT or SAMPLE/IMPACT:FAULT by commas, at the first attempt",
        )  # fmt: skip
        for name, description, high in (
            ("sampling_rate", "[Hz]", 1e9),
            ("record_duration", "[s]", 3600.0),
            ("pre_trigger", "from the first point to the contact [s]", 3600.0),
            ("hammer_full_scale", "of the hammer channel [m/s^2]", 1e9),
            ("specimen_full_scale", "of the sample channel [m/s^2]", 1e9),
            ("noise", "white, standard deviation as part of full scale [-]", 1.0),
            ("offset", "unknown to the analysis, part of full scale [-]", 1.0),
            ("drift", "change of the offset over a record, part of full scale [-]", 1.0),
            ("coupling_frequency", "-3 dB of the AC coupling [Hz]; 0: DC", 1e6),
            ("trigger_jitter", "standard deviation of the trigger's position [s]", 1.0),
        ):
            self.declare(name, getattr(digitizer, name), description, low=0.0, high=high)
        self.declare("bits", digitizer.bits, "resolution of the digitizer", low=4, high=31)

    def configure(self) -> None:
        """Read how the virtual rig behaves."""
        digitizer = DigitizerSettings(
            **{name: self.get_value(name) for name in DigitizerSettings.__dataclass_fields__}
        )
        plants = {plant.value: plant for plant in Plant}
        if self.get_value("plant") not in plants:
            raise DeviceError(
                f"plant is {self.get_value('plant')!r}: it must be one of " + ", ".join(plants)
            )
        plan = FaultPlan(
            probability=self.get_value("fault_probability"),
            faults=faults_from_names(split_names(self.get_value("faults"))),
            scheduled=tuple(
                map(scheduled_fault_from_text, split_names(self.get_value("scheduled_faults")))
            ),
        )
        self._rig_settings = VirtualRigSettings(
            plant=plants[self.get_value("plant")],
            seed=self.get_value("seed"),
            contact_time_scatter=self.get_value("contact_time_scatter"),
            amplitude_scatter=self.get_value("amplitude_scatter"),
            pulse_shape=pulse_shape_from_name(self.get_value("pulse_shape")),
            asymmetry=self.get_value("asymmetry"),
            hammer_damping=self.get_value("hammer_damping"),
            digitizer=digitizer,
            faults=plan,
        )
        if self._rig is not None:
            self._rig = VirtualRig(self._rig.setup, self._rig_settings)

    def activate(self) -> None:
        """Say that the accelerometers can be armed."""
        self._finish("ready")

    def deactivate(self) -> None:
        """Disarm."""
        if self.context.ok():
            self._finish("node inactive")

    def diagnose(self) -> dict[str, Any]:
        """Return how much has been streamed."""
        return {
            "record": self._record,
            "armed": self._label is not None,
            "blocks sent": self._blocks_sent,
            "subscribers": self._acceleration.get_subscription_count(),
        }

    def _take_setup(self, message: RigSetup) -> None:
        self._rig = VirtualRig(setup_from_msg(message), self._rig_settings)

    async def _arm(self, request: Arm.Request, response: Arm.Response) -> Arm.Response:
        await self.wait_until(
            lambda: bool(self._rig) and not self._find_missing_subscribers(), CONNECTION_TIMEOUT
        )
        label = HitLabel(
            sample=request.sample,
            record=self._record + 1,
            impact=request.impact,
            attempt=request.attempt,
        )
        armed = self._label
        if armed is not None and not self._struck and armed == replace(label, record=armed.record):
            # The same request again: its first answer was lost.
            response.success, response.record = True, armed.record
            return response
        response.message = self._find_obstacle(label)
        response.success = not response.message
        if response.success:
            self._label, self._struck = label, False
            self._record = response.record = label.record
            self._publish_state(
                state=AcquisitionState.ARMED,
                record=label.record,
                sample=label.sample,
                message="waiting for the trigger",
            )
        return response

    def _find_obstacle(self, label: HitLabel) -> str:
        """Return why the accelerometers may not be armed; empty: they may."""
        if not self.is_active:
            return "the accelerometer node is not active: activate it first"
        if self._label is not None:
            return f"already armed for record {self._label.record}: disarm first"
        if self._rig is None:
            return "no set-up has been received: start the campaign node first"
        if missing := self._find_missing_subscribers():
            return f"{missing}: start it first, or change the parameter required_subscribers"
        try:
            self._rig.check_sample(label.sample)
        except RigError as error:
            return str(error)
        return ""

    def _find_missing_subscribers(self) -> str:
        return self.find_missing_subscribers(
            self._acceleration, self.get_value("required_subscribers")
        )

    def _disarm(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._finish("disarmed by the operator")
        response.success, response.message = True, "disarmed"
        return response

    def _swing(self, message: HammerRelease) -> None:
        label = self._label
        if not self.is_active or self._rig is None or label is None:
            return
        if message.record != label.record or self._struck:
            return
        self._struck = True
        hit = self._rig.strike(label)
        self._virtual_impact.publish(messages.virtual_hit_to_msg(hit, message.header.stamp))
        wait = message.swing_time
        if Fault.MISSED_TRIGGER in hit.faults:
            wait += float(self.get_value("trigger_timeout"))
        self.run_once_after(wait, lambda: self._stream(hit))

    def _stream(self, hit: VirtualHit) -> None:
        if self._label != hit.label:
            return
        stamp = self.get_clock().now().nanoseconds
        for block in hit.split(int(self.get_value("block_size")), stamp):
            self._acceleration.publish(messages.block_to_msg(block))
            self._blocks_sent += 1
        self._finish("record complete")

    def _finish(self, message: str) -> None:
        self._label = None
        self._publish_state(state=AcquisitionState.IDLE, record=self._record, message=message)


def main() -> int:
    """Run the node."""
    return run_node(AccelerometerNode)


if __name__ == "__main__":
    raise SystemExit(main())
