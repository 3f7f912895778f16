"""How the virtual rig behaves: its parameters, declared and read."""

from impact_rig.core.errors import DeviceError
from impact_rig.core.model.pulses import PULSE_SHAPES
from impact_rig.devices.virtual.choices import Fault, Plant
from impact_rig.devices.virtual.digitizer import DigitizerSettings
from impact_rig.devices.virtual.faults import (
    FaultPlan,
    faults_from_names,
    scheduled_fault_from_text,
)
from impact_rig.devices.virtual.plants import pulse_shape_from_name
from impact_rig.devices.virtual.rig import VirtualRigSettings
from impact_rig.nodes.rig_node import RigNode, split_names


def declare_virtual_rig(node: RigNode) -> None:
    """Declare the parameters of plant, digitizer and faults."""
    rig, digitizer = VirtualRigSettings(), DigitizerSettings()
    plants = ", ".join(plant.value for plant in Plant)
    shapes = ", ".join(shape.name for shape in PULSE_SHAPES)
    faults = ", ".join(fault.value for fault in Fault)
    node.declare("plant", rig.plant.value, f"physics of the virtual rig: {plants}")
    node.declare("seed", rig.seed, "the same seed gives the same hits [-]", low=0, high=2**62)
    node.declare("contact_time_scatter", rig.contact_time_scatter,
                 "standard deviation of tau_p from hit to hit, relative [-]",
                 low=0.0, high=0.2)  # fmt: skip
    node.declare("amplitude_scatter", rig.amplitude_scatter,
                 "standard deviation of the force from hit to hit, relative [-]",
                 low=0.0, high=0.2)  # fmt: skip
    node.declare("pulse_shape", rig.pulse_shape.name, f"of the contact force: {shapes}")
    node.declare("asymmetry", rig.asymmetry,
                 "rise of the pulse over its fall, as a part of its length [-]",
                 low=-0.5, high=0.5)  # fmt: skip
    node.declare("hammer_damping", rig.hammer_damping, "c1 of the virtual hammer [N s/m]",
                 low=0.0, high=1e9)  # fmt: skip
    node.declare("fault_probability", 0.0, "of each fault, drawn for each hit [-]",
                 low=0.0, high=1.0)  # fmt: skip
    node.declare("faults", "", f"those drawn, by commas; empty: all of {faults}")
    node.declare(
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
        node.declare(name, getattr(digitizer, name), description, low=0.0, high=high)
    node.declare("bits", digitizer.bits, "resolution of the digitizer", low=4, high=31)


def read_virtual_rig(node: RigNode) -> VirtualRigSettings:
    """Return the settings that the node's parameters make.

    Raises
    ------
    RigError
        If a plant, a fault or a pulse shape is unknown, or the settings cannot be meant.
    """
    digitizer = DigitizerSettings(
        **{name: node.get_value(name) for name in DigitizerSettings.__dataclass_fields__}
    )
    plants = {plant.value: plant for plant in Plant}
    if node.get_value("plant") not in plants:
        raise DeviceError(
            f"plant is {node.get_value('plant')!r}: it must be one of " + ", ".join(plants)
        )
    plan = FaultPlan(
        probability=node.get_value("fault_probability"),
        faults=faults_from_names(split_names(node.get_value("faults"))),
        scheduled=tuple(
            map(scheduled_fault_from_text, split_names(node.get_value("scheduled_faults")))
        ),
    )
    return VirtualRigSettings(
        plant=plants[node.get_value("plant")],
        seed=node.get_value("seed"),
        contact_time_scatter=node.get_value("contact_time_scatter"),
        amplitude_scatter=node.get_value("amplitude_scatter"),
        pulse_shape=pulse_shape_from_name(node.get_value("pulse_shape")),
        asymmetry=node.get_value("asymmetry"),
        hammer_damping=node.get_value("hammer_damping"),
        digitizer=digitizer,
        faults=plan,
    )
