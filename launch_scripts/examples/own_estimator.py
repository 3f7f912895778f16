"""A node of yours is the estimator: it judges every hit, and a campaign ends with its results."""

import math
from contextlib import closing

import numpy as np
from impact_rig_msgs import msg, srv

from impact_rig.nodes import interfaces
from impact_rig.nodes.listener import BackgroundNode
from impact_rig.testing import run_rig

NAME = "half width 1.0"
"""Whose results these are: the page, results.json and the report say so."""
OTHERS = ("hammer", "accelerometer", "recorder", "campaign")


def make_unknown(message):
    """Return a message whose numbers are all not determined."""
    for name, kind in message.get_fields_and_field_types().items():
        if kind == "double":
            setattr(message, name, math.nan)
        elif "/" in kind and "sequence" not in kind:
            make_unknown(getattr(message, name))
    return message


class Estimator(BackgroundNode):
    """Takes twice the width at half amplitude for the contact time of a hit."""

    def __init__(self, domain):
        # The accelerometers arm once a node of this name listens to them.
        super().__init__("estimator", domain)
        self.setup, self.blocks, self.hits = msg.RigSetup(), [], []
        self.impact, self.estimate = map(self.advertise, (interfaces.IMPACT, interfaces.ESTIMATE))
        self.listen(interfaces.ACCELERATION, self.blocks.append)
        self.listen(interfaces.RECORD_STORED, self.judge)
        self.node.create_service(srv.JoinCampaign, "estimator/join", self.join)
        self.node.create_service(srv.GetResults, interfaces.GET_RESULTS, self.answer)

    def advertise(self, topic):
        """Publish on one of the rig's topics."""
        return self.node.create_publisher(topic.type, topic.name, topic.leased_qos)

    def listen(self, topic, callback):
        """Subscribe to one of the rig's topics."""
        self.node.create_subscription(topic.type, topic.name, callback, topic.qos)

    def join(self, request, response):
        """Take part in a campaign, or go on with it."""
        if request.setup.campaign_id != self.setup.campaign_id:
            self.setup = request.setup
            self.blocks.clear()
            self.hits.clear()
        response.success = True
        return response

    def judge(self, stored):
        """Publish the verdict on a record that is on the disk, and its sample's estimate."""
        mine = [block for block in self.blocks if block.record == stored.record]
        self.blocks.clear()
        if stored.campaign_id != self.setup.campaign_id or len(mine) < stored.blocks:
            return
        size = np.abs(np.concatenate([it.hammer.counts for it in mine]) * mine[0].hammer.scale)
        above = np.flatnonzero(size > 0.5 * size.max())
        hit = make_unknown(msg.Impact(header=mine[0].header, origin=mine[0].origin, accepted=True))
        for name in ("campaign_id", "stream_id", "record", "sample", "impact", "attempt"):
            setattr(hit, name, getattr(stored, name))
        hit.contact_time = 2.0 * (above[-1] - above[0]) / mine[0].sampling_rate
        hit.hammer_peak = size.max()
        self.hits.append(hit)
        self.impact.publish(hit)
        self.estimate.publish(self.average(hit.sample))

    def average(self, sample):
        """Return the estimate of a sample: the mean of its hits, and 2 % as its U at 95 %."""
        times = [hit.contact_time for hit in self.hits if hit.sample == sample]
        found = make_unknown(msg.SampleEstimate(name=sample, impacts_accepted=len(times)))
        found.campaign_id, found.contact_time_spread = self.setup.campaign_id, np.std(times)
        mean = float(np.mean(times))
        time = found.contact_time
        time.value, time.standard, time.expanded = mean, 0.01 * mean, 0.02 * mean
        time.lower, time.upper = 0.98 * mean, 1.02 * mean
        return found

    def answer(self, request, response):
        """Say what was found; before each hit the campaign asks for the counts alone."""
        samples = list(dict.fromkeys(hit.sample for hit in self.hits))
        found = [self.average(name) for name in samples]
        response.estimator, response.setup = NAME, self.setup
        response.counts = [
            msg.SampleCount(sample=it.name, accepted=it.impacts_accepted) for it in found
        ]
        response.newest_record = max((hit.record for hit in self.hits), default=0)
        if not request.counts_only:
            response.samples, response.accepted = found, self.hits
            make_unknown(response.hammer)
        return response


if __name__ == "__main__":
    with run_rig(only=OTHERS) as rig, closing(Estimator(rig.domain)):
        print(rig.campaign(["steel small", "aluminium large"], impacts=3))
