"""An act at the page whose node stands still is done in time, or never: arm, start and others."""

import contextlib
import http.client
import random
import re
import signal
import threading
import time
import urllib.parse
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any, TypeAlias

from action_msgs.srv import CancelGoal
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.srv import Act

from bench.measure import Bench, Figure
from bench.rig_processes import RigProcesses
from impact_rig.core.given.errors import DeviceError, RigError
from impact_rig.nodes import interfaces
from impact_rig.nodes.acts import REACTION
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
Form: TypeAlias = tuple[str, dict[str, str]]
"""Name and fields of a form of the page."""


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
        """Begin a campaign on one sample."""
        fields = {"samples": [SAMPLE], "impacts": 1, **goal}
        wanted = RunCampaign.Goal(campaign_id=id_to_msg(make_id()), **fields)
        request = GOAL.Request(goal_id=wanted.campaign_id, goal=wanted)
        before = self.campaign.number
        self.call(GOAL, SEND_GOAL, request, PATIENCE)
        self.wait_for(lambda: self.campaign.number > before + 1, f"the campaign {goal}")

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

    # What each act needs; then the act, as a form of the page.

    def prepare(self, act: str) -> Form:
        """Bring the rig to where an act is asked for; return the form's name and its fields."""
        if act == "arm":
            self.do(interfaces.DISARM_HAMMER)
            self.wait_for(lambda: not self.hammer.armed, "the disarmed hammer")
            return "arm", {}
        if act == "start":
            return "start", {"sample": SAMPLE, "impacts": "1"}
        if act == "mounted":
            self.begin(confirm_samples=True)
            self.wait_for(lambda: self.campaign.task is Task.MOUNT, "MOUNT")
            return "mounted", {"sample": SAMPLE}
        self.begin(impacts=2)
        self.wait_for(lambda: self.campaign.task is Task.PUT_BACK, "PUT BACK")
        self.wait_for(lambda: not self.hammer.armed, "the disarmed hammer")
        if act == "back":
            return "confirm", {}
        self.do(interfaces.PAUSE_CAMPAIGN)
        self.do(interfaces.CONFIRM_HELD)
        self.wait_for(lambda: self.campaign.task is Task.RESUME, "the pause")
        return "resume", {}


class Page:
    """The page's server, asked as a browser does."""

    def __init__(self, host: str) -> None:
        self._host = host

    def read_seen(self) -> str:
        """Return what an act is made from that is done now."""
        connection = http.client.HTTPConnection(self._host, timeout=PATIENCE)
        connection.request("GET", "/")
        found = re.search(r'name="seen" value="([^"]+)"', connection.getresponse().read().decode())
        connection.close()
        if found is None:
            raise RigError("the page has no form with what was shown")
        return found[1]

    def shows(self, person: Person) -> bool:
        """Return whether it shows the states that a person knows."""
        _, _, hammer, _, campaign, _ = self.read_seen().split()
        return (int(hammer), int(campaign)) == (person.hammer.number, person.campaign.number)

    def send(self, form: Form, seen: str) -> None:
        """Send a form; nobody waits for the answer."""
        threading.Thread(target=self._post, args=(*form, seen), daemon=True).start()

    def _post(self, act: str, fields: dict[str, str], seen: str) -> None:
        connection = http.client.HTTPConnection(self._host, timeout=PATIENCE)
        body = urllib.parse.urlencode({**fields, "seen": seen})
        kind = "application/x-www-form-urlencoded"
        headers = {"Content-Type": kind, "Origin": f"http://{self._host}"}
        with contextlib.closing(connection):
            connection.request("POST", f"/{act}", body, headers)
            connection.getresponse()


ACTS = ("arm", "start", "mounted", "back", "go on")
NODES = ("page", "campaign", "hammer")
"""On the way of an act."""


def measure_acts(bench: Bench) -> Iterator[Figure]:
    """Freeze a node around an act, many times; count what was done after its time."""
    dice = random.Random(bench.extent.seed)
    done: Counter[str] = Counter()
    late: list[str] = []
    longest = 0.0
    log = bench.folder / "log.txt"
    with RigProcesses(log) as processes:
        running = processes.start_rig(bench.folder, HAMMER)
        running["page"] = processes.start_node("page", port=0)
        processes.wait_until(lambda: "page listens at" in log.read_text(), "there is no page")
        page = Page(re.findall(r"page listens at http://(\S+)", log.read_text())[0])
        with Person() as person:
            person.wait_for(lambda: bool(person.hammer.stamp and person.campaign.stamp), "the rig")
            for number in range(bench.extent.acts):
                act, victim = dice.choice(ACTS), dice.choice(NODES)
                around, seconds = dice.uniform(-AROUND, AROUND), dice.uniform(*FREEZE)
                person.end()
                form, process = person.prepare(act), running[victim]
                person.wait_for(lambda: page.shows(person), "the newest state on the page")
                seen = page.read_seen()
                if around < 0.0:
                    process.send_signal(signal.SIGSTOP)
                    person.spin_until(lambda: False, -around)
                person.moved.clear()
                asked = time.monotonic()
                page.send(form, seen)
                if around >= 0.0:
                    person.spin_until(lambda: False, around)
                    process.send_signal(signal.SIGSTOP)
                person.spin_until(lambda: False, seconds)
                process.send_signal(signal.SIGCONT)
                person.spin_until(lambda: False, WATCH)
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
