"""Publishes blocks of two channels without a break, as a fast digitizer does; its own process.

Called with the duration [s]. Waits for a recorder that records, prints a line, streams, and prints
what it did as JSON.
"""

import array
import json
import sys
import time

import numpy as np
import rclpy
from impact_rig_msgs.msg import AccelerationBlock, Channel, RecorderState
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor

from impact_rig.bench.stream_plan import (
    BITS,
    BLOCK_POINTS,
    DIFFERENT_BLOCKS,
    PERIOD,
    SAMPLING_RATE,
)
from impact_rig.nodes import interfaces

PATIENCE = 30.0
"""How long the recorder may take to come up [s]."""
SAMPLE = "steel large"


def make_blocks() -> list[AccelerationBlock]:
    """Return blocks of noise over the whole range of the digitizer."""
    generator = np.random.default_rng(1)
    half = 1 << (BITS - 1)

    def make_channel() -> Channel:
        counts = generator.integers(-half, half, BLOCK_POINTS, dtype=np.int32)
        return Channel(
            counts=array.array("i", counts.tobytes()), scale=1.0, full_scale=float(half)
        )

    return [
        AccelerationBlock(
            record=1,
            sample=SAMPLE,
            impact=1,
            attempt=1,
            sampling_rate=SAMPLING_RATE,
            triggered=True,
            hammer=make_channel(),
            specimen=make_channel(),
        )
        for _ in range(DIFFERENT_BLOCKS)
    ]


def main(duration: str) -> None:
    """Stream for as long as is asked for."""
    rclpy.init()
    node = rclpy.create_node("stream")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    topic, state_topic = interfaces.ACCELERATION, interfaces.RECORDER_STATE
    publisher = node.create_publisher(topic.type, topic.name, topic.qos)
    states: list[RecorderState] = []
    node.create_subscription(state_topic.type, state_topic.name, states.append, state_topic.qos)
    blocks = make_blocks()
    deadline = time.monotonic() + PATIENCE
    while not (states and states[-1].recording):
        executor.spin_once(timeout_sec=0.1)
        if time.monotonic() > deadline:
            raise SystemExit("the recorder does not record")
    print("begin", flush=True)
    total = round(float(duration) / PERIOD)
    longest_delay = 0.0
    started = time.monotonic()
    for number in range(total):
        due = started + number * PERIOD
        if (wait := due - time.monotonic()) > 0.0:
            time.sleep(wait)
        longest_delay = max(longest_delay, time.monotonic() - due)
        block = blocks[number % DIFFERENT_BLOCKS]
        block.first_sample = number * BLOCK_POINTS
        block.last = number == total - 1
        publisher.publish(block)
    taken = time.monotonic() - started
    publisher.wait_for_all_acked(Duration(seconds=PATIENCE))
    print(
        json.dumps({"blocks": total, "seconds": taken, "longest_delay_s": longest_delay}),
        flush=True,
    )
    rclpy.shutdown()


if __name__ == "__main__":
    main(*sys.argv[1:])
