"""A rig with a page, and a browser that looks at it."""

import contextlib
import os
import re
import signal
import subprocess

import pytest
from impact_rig_msgs.srv import Act

from impact_rig.nodes import interfaces
from impact_rig.nodes.client import RigClient
from impact_rig.testing import use_own_domain

from .conftest import PATIENCE, start_command

sync_api = pytest.importorskip("playwright.sync_api")
expect = sync_api.expect
MILLISECONDS = 40_000
ARM_FIRST = re.compile(r"^(\w+\. )?ARM FIRST")
"""The sentence after a stop: of a campaign before it, the end stays in sight."""


def wait_for_line(process, word):
    """Return what a process has printed, up to a line with a word."""
    said = []
    for line in process.stdout:
        said.append(line)
        if word in line:
            return "".join(said)
    raise AssertionError(f"it ended and never said {word!r}, but {''.join(said)}")


class RunningRig:
    """A rig with a page; `numbers` are those of its nodes' processes, by name."""

    def __init__(self, folder, rig_file, *settings):
        (folder / "rig.toml").write_text(rig_file, "utf-8")
        self.folder = folder / "run"
        self.state = folder / "state"  # with the token
        options = [word for setting in settings for word in ("--set", setting)]
        self._processes, self.numbers = [], {}
        said = self._start(
            "ready: ", "up", "--rig-file", folder / "rig.toml", "--output", self.folder,
            "--no-visualizer", "--page", "--set", "page.port=0", *options,
        )  # fmt: skip
        self.port, query = re.search(r"the page is at \S+:(\d+)/(\S*)", said).groups()
        self.token = query.partition("=")[2]
        # By the loopback address: nothing leaves this computer.
        self.link = f"http://127.0.0.1:{self.port}/{query}"
        self.client = RigClient("other")

    def _start(self, word, *words):
        env = {"XDG_STATE_HOME": str(self.state)}
        process = start_command(*words, stderr=subprocess.STDOUT, env=env)
        self._processes.insert(0, process)
        said = wait_for_line(process, word)
        found = re.findall(r"(\w+) started \(pid=(\d+)\)", said)
        self.numbers.update((name, int(number)) for name, number in found)
        return said

    def restart_page(self, page):
        """Kill the page's server; serve the page again, at the port that it had."""
        os.kill(self.numbers["page"], signal.SIGKILL)
        say(page, "NO CONNECTION: KEEP AWAY")
        self._start("the page is at", "page", "--port", self.port, "--address", "0.0.0.0")

    @contextlib.contextmanager
    def frozen(self, name):
        """Let a node stand still."""
        with frozen(self.numbers[name]):
            yield

    def do(self, act, by=""):
        """Act on the hammer without the page; return whether it is done."""
        service = interfaces.HAMMER_ACTS[act]
        return self.client.call(Act, service, Act.Request(by=by), PATIENCE).success

    def stop(self):
        self.client.leave()
        for process in self._processes:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=PATIENCE)


@contextlib.contextmanager
def run_rig(*options):
    """Run a rig in a domain of its own."""
    with use_own_domain():
        running = RunningRig(*options)
        try:
            yield running
        finally:
            running.stop()


@contextlib.contextmanager
def frozen(*numbers):
    """Let processes stand still."""
    for number in numbers:
        os.kill(number, signal.SIGSTOP)
    try:
        yield
    finally:
        for number in numbers:
            with contextlib.suppress(ProcessLookupError):
                os.kill(number, signal.SIGCONT)


def say(page, text):
    """Wait until the sentence begins with a text, or matches a pattern."""
    sentence = expect(page.locator(".say:visible b"))
    pattern = re.compile("^" + re.escape(text)) if isinstance(text, str) else text
    sentence.to_contain_text(pattern, timeout=MILLISECONDS)
    # White on each of its colours.
    sentence.to_have_css("color", "rgb(255, 255, 255)")


def press(page, label):
    """Press a button."""
    page.get_by_role("button", name=label).click()


def start(page, *samples, impacts=1, ask=False, button="Start"):
    form = page.locator("#start form")
    for box in form.locator("input[name=sample]").all():
        box.set_checked(box.get_attribute("value") in samples)
    form.locator("input[name=impacts]").fill(str(impacts))
    form.locator("input[name=ask]").set_checked(ask)
    form.get_by_role("button", name=button).click()


def give_name(page, name):
    page.locator("input[name=who]").fill(name)
    press(page, "Keep it")
    page.reload()
