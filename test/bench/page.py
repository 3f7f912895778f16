"""The page at the rig: how soon a stop is confirmed, and what five open pages cost."""

import re
import shutil
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import psutil

from bench.measure import Bench, Figure
from bench.rig_processes import RigProcesses, use_own_domain
from impact_rig.core.errors import RigError

STOPS = 40
TABS = 9
LONGEST_MEDIAN, LONGEST_TAIL = 40.0, 100.0  # [ms], median and 99th percentile, as asked for
MOST_LOAD = 0.1  # [cores] of the page's node with five pages open, as asked for
LONGEST_FIRST_LOAD = 500.0  # [ms], as asked for
# In the browser: from the click until the page says that the hammer is stopped [ms].
MEASURE_STOP = """() => new Promise((resolve) => {
  const start = performance.now();
  const say = document.getElementById("say");
  new MutationObserver((_, observer) => {
    if (!say.textContent.startsWith("STOPPED")) return;
    observer.disconnect();
    resolve(performance.now() - start);
  }).observe(say, { childList: true });
  document.querySelector("#stop button").click();
})"""


def measure_page(bench: Bench) -> Iterator[Figure]:
    """Stop a rig by its page in a real browser, with nine tabs open, while hits are struck."""
    try:
        from playwright.sync_api import sync_playwright
    except ModuleNotFoundError:
        raise RigError("the browser's hands, playwright, are not installed") from None
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        raise RigError("there is no browser: on Debian, apt-get install chromium")
    log = bench.folder / "log"
    with use_own_domain() as environment, RigProcesses(environment, log) as processes:
        processes.start_command(
            "up", "--output", str(bench.folder / "run"), "--no-visualizer",
            "--page", "--set", "page.port=0",
        )  # fmt: skip
        processes.wait_until(lambda: "ready: " in log.read_text("utf-8"), "no rig is ready")
        text = log.read_text("utf-8")
        link, number = (
            _find(r"the page is at (\S+)", text),
            int(_find(r"page started \(pid=(\d+)\)", text)),
        )
        with sync_playwright() as playwright:
            started = playwright.chromium.launch(
                executable_path=browser, args=["--no-sandbox", "--disable-gpu"]
            )
            context = started.new_context()
            tabs = [context.new_page() for _ in range(TABS)]
            loads = [_load(tab, link) for tab in tabs]
            yield Figure("page, first load", loads, "ms", most=LONGEST_FIRST_LOAD)
            times = list(_stop_often(tabs[0]))
            note = f"{TABS} tabs open"
            yield Figure("click to STOPPED on the page", times, "ms", note, most=LONGEST_MEDIAN)
            tail = float(np.percentile(times, 99))
            yield Figure("99th percentile of it", tail, "ms", most=LONGEST_TAIL)
            for tab in tabs[5:]:
                tab.close()
            load = _measure_load(tabs[0], psutil.Process(number))
            yield Figure("page's node, five pages, hits struck", load, "cores", most=MOST_LOAD)
            started.close()


def _find(pattern: str, text: str) -> str:
    if (found := re.search(pattern, text)) is None:
        raise RigError(f"the rig never said {pattern!r}")
    return found[1]


def _load(tab: Any, link: str) -> float:
    """Return how long a page takes until it is live [ms]."""
    begin = time.perf_counter()
    tab.goto(link)
    tab.locator("html.live").wait_for(state="attached")
    return (time.perf_counter() - begin) * 1e3


def _stop_often(tab: Any) -> Iterator[float]:
    for _ in range(STOPS):
        yield float(tab.evaluate(MEASURE_STOP))
        tab.get_by_role("button", name="Reset the stop").click()
        tab.get_by_role("button", name="Arm", exact=True).wait_for()


def _measure_load(tab: Any, node: psutil.Process, seconds: float = 10.0) -> float:
    """Return the processor time of the page's node while a campaign runs [cores]."""
    form = tab.locator("#start form")
    form.locator("input[name=impacts]").fill("100")
    form.locator("button.main").click()
    tab.locator("form[action=end] button").wait_for()
    before, begin = sum(node.cpu_times()[:2]), time.perf_counter()
    tab.wait_for_timeout(seconds * 1e3)
    used = sum(node.cpu_times()[:2]) - before
    duration = time.perf_counter() - begin
    tab.evaluate("document.querySelector('form[action=end]').requestSubmit()")
    return float(used / duration)
