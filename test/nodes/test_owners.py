"""On a topic of the rig one node speaks: a second is named, and nothing is armed or believed."""

import html
import re
import signal
import sys
import time
import urllib.request
from copy import deepcopy
from functools import partial

import pytest
from impact_rig_msgs.srv import Act
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.serialization import serialize_message
from terminal import Terminal, run_program

from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.client import RigClient
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.intake import UNNAMED
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.nodes.rig_node import RigNode
from impact_rig.recordings.scan import Scan

from .campaigns import arm

RIG = (sys.executable, "-m", "impact_rig.cli.main")
SILENT = PublisherEventCallbacks(use_default_callbacks=False)
"""A publisher with events outlives its end until the executor has looked at them."""


def speak(harness, topic, *, is_leased=False):
    """Become a publisher of a topic, as a node without a lease or as one of the rig is."""
    qos = topic.leased_qos if is_leased else topic.qos
    publisher = harness.peer.create_publisher(topic.type, topic.name, qos, event_callbacks=SILENT)
    publisher.publish(topic.type())
    return publisher


class Forger(RigClient):
    """A stranger that repeats what it hears, with other numbers and the campaign's own ids."""

    def __init__(self):
        super().__init__("forger")
        self.heard, self.forged, self._has_lease = {}, set(), False
        for topic in interfaces.OWNED_TOPICS:
            keep = partial(self.heard.__setitem__, topic.name)
            self._node.create_subscription(topic.type, topic.name, keep, topic.qos)

    def forge(self, topic):
        """Return the newest message of a topic, with other texts and numbers."""
        message = deepcopy(self.heard.get(topic.name, topic.type()))
        for name, kind in message.get_fields_and_field_types().items():
            if kind in ("double", "string"):
                value = 2.0 * getattr(message, name) if kind == "double" else "evil"
                setattr(message, name, value)
        self.forged.add(serialize_message(message))
        return message

    def speak_until(self, topic, is_enough):
        """Speak on a topic until that is enough, then go."""
        # Of `ros2 topic pub`, and of what `ros2 bag record` has of ours.
        self._has_lease = not self._has_lease
        qos = topic.leased_qos if self._has_lease else topic.qos
        publisher = self._node.create_publisher(
            topic.type, topic.name, qos, event_callbacks=SILENT
        )

        def speak():
            publisher.publish(self.forge(topic))
            return is_enough()

        self.spin_until(speak, 30.0)
        self._node.destroy_publisher(publisher)

    def arm(self):
        """Arm the hammer, as a person does; return the answer."""
        return self.call(Act, interfaces.ARM_HAMMER, Act.Request(), 60.0).message


STRIKE = ("campaign", "--sample", "steel small", "--impacts", "9999")
UP = ("up", "--no-visualizer", "--page", "--set", "page.port=0", "--set", "hammer.swing_time=0.2")


def test_what_each_says_of_a_stranger_that_speaks_on_a_topic(ros_domain, tmp_path):
    """`-s` prints the table."""
    folder, named = tmp_path / "run", {}
    with Terminal([*RIG, *UP, "--output", folder]) as rig:
        rig.wait_for("the page is at http")
        link = re.search(r"the page is at (http://\S+)", rig.text)[1]
        with Terminal([*RIG, *STRIKE]) as campaign, Forger() as forger:
            campaign.wait_for("accepted")
            for topic in interfaces.OWNED_TOPICS:
                if topic is interfaces.STREAM:
                    continue  # who speaks alone is the owner: in triggered mode nobody listens
                start, said = len(campaign.text), named.setdefault(topic.name, set())
                told = f"/forger speaks on {topic.name} beside its {topic.owners[0]}: end"

                def is_said(start=start, said=said, told=told):
                    assert rig.process.poll() is None, rig.text
                    page = urllib.request.urlopen(link).read().decode()
                    texts = {
                        "client": campaign.text[start:],
                        "page": html.unescape(page),
                        "log": rig.text,
                        "hammer": forger.arm(),
                    }
                    said.update(name for name, text in texts.items() if told in text)
                    return len(said) == len(texts)

                forger.speak_until(topic, is_said)
                seen = len(campaign.text)

                def goes_on(seen=seen):
                    return forger.arm() and "accepted" in campaign.text[seen:]

                assert forger.spin_until(goes_on, 60.0)
            campaign.interrupt()
    recording = folder / "session.mcap"
    recorded = [raw for raw in Scan(recording).read_messages() if bytes(raw.data) in forger.forged]
    info = run_program([*RIG, "info", recording]).stdout
    analyzed = run_program([*RIG, "analyze", recording, "--json"]).stdout
    reason = "the hammer was disarmed before the contact: /forger speaks on "
    for name, said in named.items():
        hits = analyzed.count(f"{reason}{name} ")
        print(f"{name:20} named by {', '.join(sorted(said))}; rejected for it: {hits}")
        assert said == {"client", "page", "log", "hammer"}
    print(f"{len(recorded)} of {len(forger.forged)} recorded;", info[: info.index("versions")])
    assert reason in analyzed
    assert not recorded
    assert info.startswith("sound: ")
    assert analyzed == (folder / "results.json").read_text("utf-8")


@pytest.mark.parametrize("is_leased", [False, True])
def test_of_a_topic_with_two_speakers_nothing_is_believed_and_of_one_everything(
    harness, is_leased
):
    topic = interfaces.RECORD_STORED
    heard = []
    node = harness.add(lambda **options: RigNode("listener", **options))
    harness.run(lambda: node.listen(topic, heard.append))
    # Whoever speaks alone is the owner, whatever it is called.
    first = speak(harness, topic, is_leased=is_leased)
    harness.wait_until(lambda: len(heard) == 1)
    assert node.intake.find_any_stranger() is None
    harness.add(RecorderNode, autostart=False)
    harness.wait_until(lambda: node.intake.find_stranger(topic) is not None)
    first.publish(topic.type())
    harness.wait_until(lambda: node.intake.ignored == 1)
    harness.run(lambda: harness.peer.destroy_publisher(first))
    harness.wait_until(lambda: node.intake.find_stranger(topic) is None)
    assert len(heard) == 1


def test_what_a_stranger_said_last_is_not_believed_either_when_it_has_gone(harness):
    """It waits for a node that is busy, and the graph has forgotten who sent it."""
    topic = interfaces.RECORD_STORED
    heard = []
    node = harness.add(lambda **options: RigNode("listener", **options))
    harness.run(lambda: node.listen(topic, heard.append))
    owner, stranger = speak(harness, topic), speak(harness, topic)
    harness.wait_until(lambda: node.intake.ignored == 2)

    def keep_busy():
        stranger.publish(topic.type())
        assert stranger.wait_for_all_acked(Duration(seconds=10))
        harness.peer.destroy_publisher(stranger)
        while harness.peer.count_publishers(topic.name) > 1:
            time.sleep(0.01)

    harness.run(keep_busy)
    harness.wait_until(lambda: node.intake.ignored == 3)
    assert node.intake.find_any_stranger() == (
        "/peer and /peer spoke on recorder/stored beside its recorder until now: wait 1 s"
    )
    harness.wait_until(lambda: owner.publish(topic.type()) or heard)


def test_who_has_no_name_yet_is_not_believed_beside_an_owner(harness, monkeypatch):
    """The name of a stranger that looks like the rig's own may come after its first message."""
    topic = interfaces.RECORD_STORED
    heard = []
    node = harness.add(lambda **options: RigNode("listener", **options))
    harness.run(lambda: node.listen(topic, heard.append))
    harness.add(RecorderNode, autostart=False)
    list_publishers = node.get_publishers_info_by_topic

    def forget_name(name):
        publishers = list_publishers(name)
        for item in publishers:
            if item.node_name == harness.peer.get_name():
                item.node_name = UNNAMED
        return publishers

    monkeypatch.setattr(node, "get_publishers_info_by_topic", forget_name)
    newcomer = speak(harness, topic, is_leased=True)
    harness.wait_until(lambda: node.intake.ignored == 1)
    assert not heard
    # It gets none: one of the rig, after a long break of the network.
    harness.wait_until(lambda: newcomer.publish(topic.type()) or heard)


def test_a_node_that_was_killed_and_started_again_is_no_stranger_to_itself(harness, start_process):
    """The middleware keeps the publishers of a killed process for a minute."""
    harness.add(AccelerometerNode)
    hammer = harness.add(HammerNode)
    estimator = start_process("estimator")
    count = lambda: harness.peer.count_publishers(interfaces.IMPACT.name)  # noqa: E731
    harness.wait_until(lambda: count() == 1)
    estimator.process.send_signal(signal.SIGKILL)
    estimator.wait()
    start_process("estimator")
    harness.wait_until(lambda: count() == 2)
    assert hammer.intake.find_any_stranger() is None
    arm(harness)
