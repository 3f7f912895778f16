"""The accelerometers with a source of another package: a digitizer on a desk."""

import time
from dataclasses import replace

from impact_rig_msgs.srv import Arm

from impact_rig.core.given.records import UNSTATED, HitLabel
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.nodes import interfaces

SAMPLE = "steel small"
SOURCE = """
[source]
driver = "desk"
sampling_rate = "2.5 MHz"
trigger_level = "5 g"
serial = 7
[source.hammer]
channel = 1
sensitivity = "10 mV/g"
[source.specimen]
channel = 2
sensitivity = "10 mV/g"
"""


def arm(harness, sample=SAMPLE, impact=1):
    request = Arm.Request(sample=sample, impact=impact, attempt=1)
    return harness.ask(Arm, interfaces.ARM_ACCELEROMETER, request)


def make_record(overloaded=False):
    """Return a good hit as one block, as a device may deliver it."""
    hit = VirtualRig(PAPER_SETUP, VirtualRigSettings(seed=3)).strike(HitLabel(SAMPLE))
    (block,) = hit.split(hit.hammer.output.size, time.time_ns())
    hammer = replace(block.hammer, overloaded=overloaded)
    return replace(block, hammer=hammer, origin=UNSTATED)


def wait_for_state(states, state, words=""):
    found = states.wait(
        lambda got: any(item.state == state and words in item.message for item in got)
    )
    return next(item for item in found if item.state == state and words in item.message)


def wait_for_release(harness, node):
    """Wait until the node has heard of a release."""
    harness.wait_until(lambda: node._arming is None or node._arming.is_released)
