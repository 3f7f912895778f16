"""Any node that publishes samples as a source, over DDS: the contract, names, units, refusals."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import AccelStamped, WrenchStamped
from impact_rig_msgs.msg import ImpactTrace
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, String

from impact_rig.configuration.toml_table import parse_toml_table
from impact_rig.core.given.errors import DeviceError, ParameterError, RigError
from impact_rig.core.given.sensors import Sensor
from impact_rig.devices.protocols import AcquisitionPlan, SourceChannel
from impact_rig.nodes.discovery import offer_profile
from impact_rig.nodes.topic_source import TopicSource
from impact_rig.testing import AccelerationSourceContract, SourceBench

RATE = 1000.0
PULSE = np.sin(np.linspace(0.0, np.pi, 9))
"""Of 8 ms, with a height of 1."""

Make = Callable[[float, float], Any]


def make_accel(hammer: float, specimen: float) -> AccelStamped:
    message = AccelStamped()
    message.accel.linear.x, message.accel.linear.y = hammer, specimen
    return message


def make_wrench(hammer: float, _: float) -> WrenchStamped:
    message = WrenchStamped()
    message.wrench.force.z = hammer
    return message


class Publisher:
    """A foreign node that samples a thousand times a second, in its own thread."""

    def __init__(self, topics: dict[str, Make], *, rate: float = RATE) -> None:
        with offer_profile():
            self._context = rclpy.Context()
            rclpy.init(context=self._context)
            self._node = Node("instrument", context=self._context)
        self._topics = [
            (
                self._node.create_publisher(type(make(0.0, 0.0)), topic, QoSProfile(depth=1000)),
                make,
            )
            for topic, make in topics.items()
        ]
        self.rate = rate
        self.height = 50.0
        self.skipped = 0  # points that are to be lost
        self.jitter = 0  # of the stamps [ns]
        self._to_come: deque[float] = deque()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def strike(self) -> None:
        self._to_come.extend(PULSE)

    @property
    def is_quiet(self) -> bool:
        return not self._to_come

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._node.destroy_node()
        self._context.try_shutdown()

    def _run(self) -> None:
        begin, count = time.time_ns(), 0
        while not self._stop.wait(0.005):
            while count / self.rate < (time.time_ns() - begin) * 1e-9:
                count += 1
                if self.skipped:
                    self.skipped -= 1
                    continue
                value = self.height * self._to_come.popleft() if self._to_come else 0.0
                stamp = begin + round(count / self.rate * 1e9) + self.jitter * (count % 2)
                for publisher, make in self._topics:
                    message = make(value, -0.5 * value)
                    if hasattr(message, "header"):
                        message.header.stamp.sec, message.header.stamp.nanosec = divmod(
                            stamp, 1_000_000_000
                        )
                    publisher.publish(message)


def make_channel(body: str, text: str, *, mass: float = np.nan, **sheet: Any) -> SourceChannel:
    table = parse_toml_table(text)
    return SourceChannel(table["channel"], Sensor(body, **sheet), mass, table.without("channel"))


ACCEL = (
    make_channel("hammer", 'channel = "/accel.accel.linear.x"'),
    make_channel("specimen", 'channel = "/accel.accel.linear.y"\nunit = "g"'),
)


def make_plan(*channels: SourceChannel, continuous: bool = False) -> AcquisitionPlan:
    hammer, specimen = (*channels, None)[:2]
    return AcquisitionPlan(RATE, 0.1, 0.02, 10.0, hammer, specimen, continuous)


class QuickSource(TopicSource):
    """It is told soon that no node is there: there is none."""

    patience = 0.2


class TopicBench(SourceBench):
    driver = TopicSource

    def __init__(self) -> None:
        self.make_source()
        self.plug()

    def make_source(self) -> TopicSource:
        self.source = TopicSource(parse_toml_table(""))
        self.source.longest_silence = 0.5
        return self.source

    def make_plan(self, *, continuous: bool = False) -> AcquisitionPlan:
        return make_plan(*ACCEL, continuous=continuous)

    def strike(self, source: TopicSource) -> None:
        self.publisher.strike()
        self.wait_until(lambda: self.publisher.is_quiet)
        count = source.count
        self.wait_until(lambda: source.count > count + 10)

    def unplug(self) -> None:
        self.source.patience = QuickSource.patience
        if self.publisher is not None:
            self.publisher.close()
            self.publisher = None

    def plug(self) -> None:
        self.source.patience = TopicSource.patience
        self.publisher = Publisher({"/accel": make_accel})


pytestmark = pytest.mark.usefixtures("ros_domain")


class TestTopicSource(AccelerationSourceContract):
    @pytest.fixture
    def bench(self) -> Iterator[TopicBench]:
        bench = TopicBench()
        yield bench
        bench.unplug()


def take_hit(
    publisher: Publisher, plan: AcquisitionPlan, options: str = "", driver: Any = TopicSource
) -> Any:
    """Return the blocks of one hit, joined: hammer and sample [m/s^2]."""
    with closing(driver(parse_toml_table(options))) as source:
        source.configure(plan)
        source.arm()
        publisher.strike()
        blocks = []
        while not blocks or not blocks[-1].last:
            blocks.append(source.read(10.0))
        return [
            np.concatenate([getattr(block, body).acceleration for block in blocks])
            for body in ("hammer", "specimen")
        ]


def test_two_topics_belong_together_by_their_stamps_and_a_force_is_that_on_the_hammer():
    channels = (
        make_channel(
            "hammer", 'channel = "/ft.wrench.force.z"', mass=0.5, quantity="force", unit="N"
        ),
        make_channel("specimen", 'channel = "/accel.accel.linear.y"'),
    )
    with closing(Publisher({"/accel": make_accel, "/ft": make_wrench})) as publisher:
        hammer, specimen = take_hit(publisher, make_plan(*channels))
        with pytest.raises(RigError, match=r"ignore_stamps is true, and .* two topics"):
            take_hit(publisher, make_plan(*channels), "ignore_stamps = true")
    assert hammer.max() == pytest.approx(100.0)
    assert specimen == pytest.approx(-0.25 * hammer)


def test_an_array_without_a_stamp_goes_by_the_rate_that_is_stated():
    def make_array(hammer: float, specimen: float) -> Float64MultiArray:
        return Float64MultiArray(data=[specimen, hammer])

    channels = (
        make_channel("hammer", 'channel = "/array.data[1]"\nunit = "m/s^2"'),
        make_channel("specimen", 'channel = "/array.data[0]"\nunit = "m/s^2"'),
    )
    with closing(Publisher({"/array": make_array})) as publisher:
        with pytest.raises(ParameterError, match="have no stamp: write ignore_stamps = true"):
            take_hit(publisher, make_plan(*channels))
        hammer, specimen = take_hit(publisher, make_plan(*channels), "ignore_stamps = true")
    assert hammer.max() == pytest.approx(50.0)
    assert specimen == pytest.approx(-0.5 * hammer)


def test_a_message_unlike_the_first_ends_the_stream_with_a_sentence():
    sizes = [2, 40]

    def make_table(*_: float) -> Float64MultiArray:
        message = Float64MultiArray(data=[0.0] * 80)
        message.layout.dim = [MultiArrayDimension(size=size) for size in sizes]
        return message

    channels = (
        make_channel("hammer", 'channel = "/table.data[0]"\nunit = "m/s^2"'),
        make_channel("specimen", 'channel = "/table.data[1]"\nunit = "m/s^2"'),
    )
    with (
        closing(Publisher({"/table": make_table}, rate=100.0)) as publisher,
        closing(TopicSource(parse_toml_table("ignore_stamps = true"))) as source,
    ):
        source.configure(replace(make_plan(*channels), sampling_rate=40.0 * publisher.rate))
        sizes[:] = [80]
        with pytest.raises(DeviceError, match="a message on /table has other fields than the"):
            source.read(1.0)


def test_of_several_faults_the_first_is_told():
    topics: dict[str, Make] = {"/daq": lambda *_: ImpactTrace(hammer=[0.0] * 40)}
    plan = make_plan(make_channel("hammer", 'channel = "/daq.hammer"\nunit = "m/s^2"'))
    with (
        closing(Publisher(topics, rate=1.09 * RATE / 40.0)) as publisher,
        pytest.raises(DeviceError, match="its points come at 1090 Hz"),
    ):
        take_hit(publisher, plan)


def test_messages_that_are_missing_are_a_gap_in_the_stream():
    with (
        closing(Publisher({"/accel": make_accel})) as publisher,
        closing(TopicSource(parse_toml_table(""))) as source,
    ):
        source.configure(make_plan(*ACCEL, continuous=True))
        source.arm()
        publisher.skipped = 17
        expected, gaps = 0, []
        while not gaps:
            block = source.read(10.0)
            gaps += [block.first_sample - expected] * (block.first_sample > expected)
            expected = block.first_sample + block.hammer.output.size
    assert gaps == [17]


@pytest.mark.parametrize(
    ("driver", "channel", "words"),
    [
        (
            TopicSource,
            "/accel.accel.linear.w",
            "AccelStamped has no number 'accel.linear.w'",
        ),
        (
            QuickSource,
            "/nowhere.x",
            r"no node publishes on /nowhere: start it first; foreign topics are /accel \([^,]*$",
        ),
        (TopicSource, "accel.x", "must be a whole topic and a number in its messages"),
    ],
)
def test_what_cannot_be_meant_is_refused_in_a_sentence(driver, channel, words):
    # The rig's own topics are not proposed, whatever their type.
    topics = {"/accel": make_accel, "/rig/note": lambda *_: String()}
    with closing(Publisher(topics)) as publisher:
        plan = make_plan(make_channel("hammer", f'channel = "{channel}"'))
        with pytest.raises(RigError, match=words):
            take_hit(publisher, plan, driver=driver)


def test_a_node_that_is_found_late_is_waited_for():
    """Its first packets are lost on a busy computer, and sent again after 3 s."""
    with ThreadPoolExecutor() as pool, closing(TopicSource(parse_toml_table(""))) as source:
        configured = pool.submit(source.configure, make_plan(*ACCEL))
        with pytest.raises(TimeoutError):
            configured.result(0.3)
        with closing(Publisher({"/accel": make_accel})):
            assert configured.result(60.0).identity


def test_units_are_those_of_the_message_or_as_written_and_uneven_stamps_and_a_second_are_refused():
    plan = make_plan(*ACCEL)
    with closing(Publisher({"/accel": make_accel})) as publisher:
        hammer, specimen = take_hit(publisher, plan)
        assert hammer.max() == pytest.approx(50.0)
        assert specimen.min() == pytest.approx(-25.0 * 9.80665)
        publisher.jitter = 300_000
        with pytest.raises(DeviceError, match="stamps of its messages are uneven"):
            take_hit(publisher, plan)
        with closing(Publisher({"/accel": make_accel})):
            while len(publisher._node.get_publishers_info_by_topic("/accel")) < 2:
                time.sleep(0.01)
            with pytest.raises(DeviceError, match="2 nodes publish on /accel"):
                take_hit(publisher, plan)
