"""When a recorded moment is due: by a clock of the test's own."""

import threading

import pytest

from impact_rig.nodes import replayer_playback
from impact_rig.nodes.replayer_playback import Pace

SECOND = 1_000_000_000
TICK = 1e-4
"""How often a waiting pace looks at the clock [s]: the test's clock takes no time."""


@pytest.fixture
def clock(move_clock):
    return move_clock(replayer_playback)


def wait(pace, clock, position, step=0.1):
    """Wait for a moment; return how long that took by the clock, and what was now meanwhile."""
    begin, seen = clock.now, []

    def tick(now):
        seen.append(now)
        clock.now += step

    assert pace.wait_for(position, tick, TICK)
    return clock.now - begin, seen


@pytest.mark.parametrize(("rate", "expected"), [(1.0, 10.0), (4.0, 2.5), (0.5, 20.0)])
def test_a_moment_is_due_at_the_rate(clock, rate, expected):
    pace = Pace(rate)
    pace.jump(5 * SECOND)
    took, seen = wait(pace, clock, 15 * SECOND)
    assert took == pytest.approx(expected, abs=0.11)
    assert seen == sorted(seen)
    assert seen[0] == 5 * SECOND


def test_what_is_late_is_due_at_once_and_the_next_is_not_late_for_that(clock):
    pace = Pace(1.0)
    pace.jump(0)
    clock.now += 7.0
    assert wait(pace, clock, 5 * SECOND) == (0.0, [])
    assert wait(pace, clock, 10 * SECOND)[0] == pytest.approx(3.0, abs=0.11)


def test_a_rate_of_0_waits_for_nothing_and_can_be_left(clock):
    pace = Pace(0.0)
    assert wait(pace, clock, 1000 * SECOND) == (0.0, [])
    pace.set_rate(2.0)
    assert wait(pace, clock, 1004 * SECOND)[0] == pytest.approx(2.0, abs=0.11)


def test_another_rate_holds_from_here_on(clock):
    pace = Pace(1.0)
    pace.jump(0)
    clock.now += 5.0
    pace.set_rate(10.0)
    assert wait(pace, clock, 25 * SECOND)[0] == pytest.approx(2.0, abs=0.11)


def test_pauses_do_not_count(clock):
    pace = Pace(1.0)
    pace.jump(0)
    clock.now += 3.0
    pace.pause()
    clock.now += 1000.0
    pace.resume()
    assert wait(pace, clock, 5 * SECOND)[0] == pytest.approx(2.0, abs=0.11)


def test_while_it_stands_still_the_moment_is_told_again_and_again(clock):
    pace = Pace(1.0, is_paused=True)
    pace.jump(7)
    seen = []

    def tick(now):
        seen.append(now)
        if len(seen) == 5:
            pace.stop()

    assert not pace.wait_for(SECOND, tick, TICK)
    assert seen == [7] * 5


def test_a_step_makes_everything_due_until_it_ends(clock):
    pace = Pace(1.0, is_paused=True)
    pace.jump(0)
    pace.step()
    assert not pace.is_paused
    assert wait(pace, clock, 60 * SECOND) == (0.0, [])
    assert pace.end_step()
    assert pace.is_paused
    assert not pace.end_step()
    pace.resume()
    assert wait(pace, clock, 61 * SECOND)[0] == pytest.approx(1.0, abs=0.11)


@pytest.mark.parametrize("wake", ["stop", "resume", "step"])
def test_who_waits_is_woken_at_once(wake):
    pace = Pace(1.0, is_paused=wake != "stop")
    pace.jump(0)
    is_waiting, results = threading.Event(), []

    def run():
        results.append(pace.wait_for(0 if wake != "stop" else 3600 * SECOND, tick, 3600.0))

    def tick(now):
        is_waiting.set()

    thread = threading.Thread(target=run)
    thread.start()
    assert is_waiting.wait(20.0)
    getattr(pace, wake)()
    thread.join(20.0)
    assert results == [wake != "stop"]
