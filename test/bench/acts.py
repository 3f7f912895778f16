"""An act whose node stands still is done in time, or never: arm, start, mounted, back, go on."""

import contextlib
import random
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

from action_msgs.srv import CancelGoal
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.srv import Act, ConfirmSample

from bench.measure import Bench, Figure
from bench.rig_processes import RigProcesses
from impact_rig.core.given.errors import DeviceError, RigError
from impact_rig.nodes import interfaces
from impact_rig.nodes.acts import REACTION, fill_act
from impact_rig.nodes.client import RigClient
from impact_rig.nodes.identity import id_to_msg, make_id
from impact_rig.nodes.intake import Received
from impact_rig.status.states import CampaignStatus, HammerStatus, Task

HAMMER = {"hammer": {"swing_time": 0.05, "confirm_return": True}}
SAMPLE = "steel small"
AROUND = 0.2  # [s], between the act and the freeze, before or after
FREEZE = (0.5, 5.0)  # [s], shorter and longer than the lease
WATCH = 3.5  # [s], after the freeze: a hammer that stood still catches up for 2.5 s
LATEST = 2.0 * REACTION + 0.5
"""When the last release may come after an act [s]: accepted up to 2 s later, it counts for 2 s."""
PATIENCE = 30.0  # [s]
SEND_GOAL = f"{interfaces.RUN_CAMPAIGN}/_action/send_goal"
CANCEL_GOAL = f"{interfaces.RUN_CAMPAIGN}/_action/cancel_goal"
GOAL = RunCampaign.Impl.SendGoalService


class Person(RigClient):
    """Acts on a rig, and sees when the hammer was armed and when it went."""

    def __init__(self) -> None:
        super().__init__("person")
        self.hammer, self.campaign = HammerStatus(), CampaignStatus()
        self.moved: list[float] = []  # when it was armed, or released [s], by the monotonic clock
        self.listen(interfaces.HAMMER_STATE, self._on_hammer)
        self.listen(interfaces.CAMPAIGN_STATE, self._on_campaign)
        self.listen(interfaces.RELEASE, lambda _: self.moved.append(time.monotonic()))

    def _on_hammer(self, received: Received[HammerStatus]) -> None:
        if received.value.armed and not self.hammer.armed:
            self.moved.append(time.monotonic())
        self.hammer = received.value

    def _on_campaign(self, received: Received[CampaignStatus]) -> None:
        self.campaign = received.value

    def wait_for(self, condition: Callable[[], bool], what: str) -> None:
        """Wait until something is so; raises `RigError` if it never is."""
        if not self.spin_until(condition, PATIENCE):
            raise RigError(f"{what} did not come within {PATIENCE:g} s: {self.campaign}")

    def do(self, service: str) -> None:
        """Act whatever the state is."""
        self.call(Act, service, Act.Request(by="bench"), PATIENCE)

    def begin(self, **goal: Any) -> None:
        """Begin a campaign."""
        self.call(GOAL, SEND_GOAL, make_goal(**goal), PATIENCE)

    def arm(self) -> None:
        """Arm the hammer; a hammer that stood still refuses for a while."""
        self.do(interfaces.RESET_HAMMER)
        deadline = time.monotonic() + PATIENCE
        while not self.call(Act, interfaces.ARM_HAMMER, Act.Request(), PATIENCE).success:
            if time.monotonic() > deadline:
                raise RigError(f"the hammer cannot be armed: {self.hammer}")
            self.spin_until(lambda: False, 0.2)

    def end(self) -> None:
        """End what runs; the hammer is in its holder, and a campaign may arm it."""
        deadline = time.monotonic() + PATIENCE
        while self.campaign.is_running:
            if time.monotonic() > deadline:
                raise RigError(f"the campaign does not end: {self.campaign}")
            # Who has not met this client's reader yet drops the answer.
            with contextlib.suppress(DeviceError):
                self.call(CancelGoal, CANCEL_GOAL, CancelGoal.Request(), 2.0)
            self.spin_until(lambda: not self.campaign.is_running, 2.0)
        self.arm()
        self.do(interfaces.CONFIRM_HELD)
        self.wait_for(lambda: self.hammer.armed and not self.hammer.is_away, "the armed hammer")

    # What each act needs; then the act, as a request of a service.

    def prepare(self, act: str) -> tuple[Any, str, Any]:
        """Bring the rig to where an act is asked for; return its service and request."""
        if act == "arm":
            self.do(interfaces.DISARM_HAMMER)
            self.wait_for(lambda: not self.hammer.armed, "the disarmed hammer")
            return Act, interfaces.ARM_HAMMER, fill_act(Act.Request(), self.hammer, "bench")
        if act == "start":
            request = make_goal()
            fill_act(request.goal, self.campaign, "bench")
            return GOAL, SEND_GOAL, request
        if act == "mounted":
            self.begin(confirm_samples=True)
            self.wait_for(lambda: self.campaign.task is Task.MOUNT, "MOUNT")
            request = ConfirmSample.Request(sample=SAMPLE)
            service = interfaces.CONFIRM_SAMPLE
            return ConfirmSample, service, fill_act(request, self.campaign, "bench")
        self.begin(impacts=2)
        self.wait_for(lambda: self.campaign.task is Task.PUT_BACK, "PUT BACK")
        self.wait_for(lambda: not self.hammer.armed, "the disarmed hammer")
        if act == "back":
            return Act, interfaces.CONFIRM_HELD, fill_act(Act.Request(), self.hammer, "bench")
        self.do(interfaces.PAUSE_CAMPAIGN)
        self.do(interfaces.CONFIRM_HELD)
        self.wait_for(lambda: self.campaign.task is Task.RESUME, "the pause")
        return Act, interfaces.RESUME_CAMPAIGN, fill_act(Act.Request(), self.campaign, "bench")


def make_goal(**goal: Any) -> Any:
    """Return the request for a campaign on one sample."""
    fields = {"samples": [SAMPLE], "impacts": 1, **goal}
    wanted = RunCampaign.Goal(campaign_id=id_to_msg(make_id()), **fields)
    return GOAL.Request(goal_id=wanted.campaign_id, goal=wanted)


ACTS = {
    "arm": ("hammer",),
    "start": ("campaign", "hammer"),
    "mounted": ("campaign", "hammer"),
    "back": ("campaign", "hammer"),
    "go on": ("campaign", "hammer"),
}
"""Acts, and the nodes on the way of each."""


def measure_acts(bench: Bench) -> Iterator[Figure]:
    """Freeze a node around an act, many times; count what was done after its time."""
    dice = random.Random(bench.extent.seed)
    done: Counter[str] = Counter()
    late: list[str] = []
    longest = 0.0
    with RigProcesses(bench.folder / "log.txt") as processes:
        running = processes.start_rig(bench.folder, HAMMER)
        with Person() as person:
            person.wait_for(lambda: bool(person.hammer.stamp and person.campaign.stamp), "the rig")
            for number in range(bench.extent.acts):
                act = dice.choice(list(ACTS))
                victim = dice.choice(ACTS[act])
                around, seconds = dice.uniform(-AROUND, AROUND), dice.uniform(*FREEZE)
                person.end()
                kind, service, request = person.prepare(act)
                process = running[victim]
                client = person._node.create_client(kind, service)
                person.wait_for(client.service_is_ready, service)
                if around < 0.0:
                    process.send_signal(signal.SIGSTOP)
                    person.spin_until(lambda: False, -around)
                person.moved.clear()
                asked = time.monotonic()
                client.call_async(request)
                if around >= 0.0:
                    person.spin_until(lambda: False, around)
                    process.send_signal(signal.SIGSTOP)
                person.spin_until(lambda: False, seconds)
                process.send_signal(signal.SIGCONT)
                person.spin_until(lambda: False, WATCH)
                person._node.destroy_client(client)
                last = max(person.moved, default=asked) - asked
                done[act] += bool(person.moved)
                longest = max(longest, last)
                if last > LATEST:
                    late.append(
                        f"{number}: {act}, {victim} frozen {around:+.2f} s for {seconds:.1f} s:"
                        f" after {last:.1f} s"
                    )
    told = ", ".join(f"{act}: {count}" for act, count in sorted(done.items()))
    note = "; ".join([f"of {bench.extent.acts}, done in time {told}", *late])
    yield Figure("acts done after their time", len(late), note=note, most=0)
    yield Figure("the latest arming or release after an act", longest, "s", most=LATEST)
