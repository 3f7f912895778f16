"""A rig with a page, and a browser that looks at it."""

import contextlib
import re
import shutil
import signal
import subprocess

import pytest

from impact_rig.testing import use_own_domain

from .conftest import PATIENCE, start_command

sync_api = pytest.importorskip("playwright.sync_api")
BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
needs_browser = pytest.mark.skipif(
    BROWSER is None, reason="no browser looks at the page: on Debian, apt-get install chromium"
)
MILLISECONDS = 40_000


def wait_for_line(process, word):
    """Return what stands behind a word in a line that a process prints."""
    said = []
    for line in process.stdout:
        if word in line:
            return line.partition(word)[2].strip()
        said.append(line)
    raise AssertionError(f"it ended and never said {word!r}, but {''.join(said)}")


class RunningRig:
    """A rig with a page; `numbers` are those of its nodes' processes, by name."""

    def __init__(self, folder, rig_file, *settings, env=None):
        (folder / "rig.toml").write_text(rig_file, "utf-8")
        self.folder, self._env = folder / "run", env or {}
        options = [word for setting in settings for word in ("--set", setting)]
        self.process = self.start(
            "up", "--rig-file", folder / "rig.toml", "--output", self.folder, "--no-visualizer",
            "--page", "--set", "page.port=0", *options,
        )  # fmt: skip
        self.page_process = None
        lines = []
        for line in self.process.stdout:
            lines.append(line)
            if "ready: " in line:
                break
        self.said = "".join(lines)
        self.link = re.search(r"the page is at (\S+)", self.said)[1]
        started = re.findall(r"(\w+) started \(pid=(\d+)\)", self.said)
        self.numbers = {name: int(number) for name, number in started}

    @property
    def port(self):
        return re.search(r":(\d+)/", self.link)[1]

    def start(self, *words):
        return start_command(*words, stderr=subprocess.STDOUT, env=self._env)

    def start_page(self, *words):
        """Serve the page again, at the port that it had."""
        self.page_process = self.start("page", "--port", self.port, *words)
        self.numbers["page"] = int(wait_for_line(self.page_process, "(pid=").rstrip(")"))
        wait_for_line(self.page_process, "the page is at")

    def stop(self):
        for process in filter(None, (self.page_process, self.process)):
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=PATIENCE)


@contextlib.contextmanager
def run_rig(*options, **settings):
    """Run a rig in a domain of its own."""
    with use_own_domain():
        running = RunningRig(*options, **settings)
        try:
            yield running
        finally:
            running.stop()


def say(page, text):
    """Wait until the sentence begins with a text."""
    sentence = sync_api.expect(page.locator(".say:visible b"))
    sentence.to_contain_text(re.compile("^" + re.escape(text)), timeout=MILLISECONDS)
    # White on each of its colours.
    sentence.to_have_css("color", "rgb(255, 255, 255)")


def start(page, *samples, impacts=1, ask=True, button="Start"):
    form = page.locator("#start form")
    for box in form.locator("input[name=sample]").all():
        box.set_checked(box.get_attribute("value") in samples)
    form.locator("input[name=impacts]").fill(str(impacts))
    form.locator("input[name=ask]").set_checked(ask)
    form.get_by_role("button", name=button).click()
