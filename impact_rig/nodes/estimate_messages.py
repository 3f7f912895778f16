"""What the estimator finds to messages.

Each names the set-up that it was found under by the stamp of that, so that whoever comes late can
tell an earlier campaign's from this one's.
"""

from array import array
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from impact_rig_msgs.msg import HammerEstimate, Impact, ModelComparison, SampleEstimate

from impact_rig.core.estimation import comparison, paper_method
from impact_rig.core.estimation import sample as estimation
from impact_rig.core.hits import hit
from impact_rig.core.signals.record import FloatArray
from impact_rig.nodes.messages import stamp_to_msg
from impact_rig.nodes.result_messages import result_to_msg
from impact_rig.results.flat_estimates import (
    hammer_results_from_body,
    sample_results_from_estimate,
)


def hit_to_msg(judged: hit.JudgedHit, setup_stamp: Time) -> Impact:
    """Return a judged hit as a message, stamped with its record's first point's time."""
    message = Impact(
        setup_stamp=setup_stamp,
        record=judged.label.record,
        sample=judged.label.sample,
        impact=judged.label.impact,
        attempt=judged.label.attempt,
        accepted=judged.accepted,
        reasons=[str(rejection) for rejection in judged.rejections],
        impact_time=judged.impact_time,
        contact_time=judged.contact_time,
        hammer_peak=judged.hammer_peak,
        specimen_peak=judged.specimen_peak,
    )
    message.header.stamp = stamp_to_msg(judged.stamp)
    return message


def hammer_to_msg(
    hammer: paper_method.BodyEstimate, control_sample: str, stamp: Time, setup_stamp: Time
) -> HammerEstimate:
    """Return the hammer's estimate as a message."""
    message: HammerEstimate = result_to_msg(hammer_results_from_body(hammer, control_sample))
    message.header.stamp, message.setup_stamp = stamp, setup_stamp
    return message


def estimate_to_msg(
    estimate: estimation.SampleEstimate, stamp: Time, setup_stamp: Time
) -> SampleEstimate:
    """Return a sample's estimate as a message."""
    message: SampleEstimate = result_to_msg(sample_results_from_estimate(estimate))
    message.header.stamp, message.setup_stamp = stamp, setup_stamp
    return message


def comparison_to_msg(
    estimate: estimation.SampleEstimate,
    compared: comparison.ModelComparison,
    stamp: Time,
    setup_stamp: Time,
) -> ModelComparison:
    """Return the traces of a model comparison as a message."""
    message = ModelComparison(
        setup_stamp=setup_stamp,
        sample=estimate.name,
        model=compared.variant.value,
        impacts_accepted=estimate.impacts_accepted,
        sampling_rate=compared.sampling_rate,
        start_time=compared.start_time,
        contact_time=compared.contact_time,
        hammer_measured=_floats(compared.hammer.measured),
        hammer_model=_floats(compared.hammer.model),
        specimen_measured=_floats(compared.specimen.measured),
        specimen_model=_floats(compared.specimen.model),
        hammer_peak=compared.hammer.peak,
        specimen_peak=compared.specimen.peak,
        hammer_shift=compared.hammer.shift,
        specimen_shift=compared.specimen.shift,
        mse_hammer_percent=compared.hammer.mse_percent,
        mse_sample_percent=compared.specimen.mse_percent,
    )
    message.header.stamp = stamp
    return message


def estimate_to_msgs(
    estimates: Sequence[estimation.SampleEstimate], stamp: Time, setup_stamp: Time
) -> list[SampleEstimate]:
    """Return several samples' estimates as messages."""
    return [estimate_to_msg(estimate, stamp, setup_stamp) for estimate in estimates]


def _floats(values: FloatArray) -> "array[float]":
    return array("f", values.astype("float32").tobytes())
