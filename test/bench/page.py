"""The page at the rig: how soon a stop and a verdict are shown, and what five pages cost."""

import os
import re
import shutil
import signal
import threading
import time
from collections.abc import Iterator
from typing import Any, Self

import numpy as np
import psutil

from bench.foreign import StrangerClient
from bench.measure import Bench, Figure, NotHereError
from bench.rig_processes import RigProcesses
from impact_rig.core.given.errors import RigError
from impact_rig.nodes import interfaces
from impact_rig.nodes.client import RigClient
from impact_rig.results.campaign import HitResults

STOPS = 40
TABS = 9
FLOOD, FLOOD_PERIOD = 5000, 0.004  # foreign messages each second, as asked for; [s]
LONGEST_MEDIAN, LONGEST_TAIL = 20.0, 60.0  # [ms], median and 99th percentile, as asked for
UNDER_WAY = 6  # acts without an answer: as many as a browser has connections
MOST_GROWTH = 0.2  # [MB/min] of the page's node while hits are struck, as asked for
GROWTH_TIME, SETTLING_TIME = 60.0, 20.0  # [s]
MOST_LOAD = 0.1  # [cores] of the page's node with five pages open, as asked for
LONGEST_FIRST_LOAD = 500.0  # [ms], as asked for
LONGEST_VERDICT = 100.0  # [ms], as asked for
# In the browser: from the click until the page says that the hammer is stopped [ms].
MEASURE_STOP = """() => new Promise((resolve) => {
  const start = performance.now();
  const say = document.getElementById("say");
  new MutationObserver((_, observer) => {
    if (!say.textContent.startsWith("STOPPED")) return;
    observer.disconnect();
    resolve(performance.now() - start);
  }).observe(say, { childList: true, subtree: true, characterData: true });
  document.querySelector("#stop button").click();
})"""

# From when the estimator publishes a verdict until the page shows it, by one clock [ms].
WATCH_VERDICTS = """() => {
  window.seen = [];
  const hits = document.getElementById("hits");
  new MutationObserver(() => {
    const record = Number(hits.querySelector("tbody td")?.textContent);
    if (record && !window.seen.some(([known]) => known === record))
      window.seen.push([record, Date.now()]);
  }).observe(hits, { childList: true, subtree: true });
}"""


class Flood:
    """Publishes messages of another campaign on the rig's topics, in a thread of its own."""

    def __init__(self, seed: int) -> None:
        self._client = StrangerClient(seed)
        self._end = threading.Event()
        self.messages = 0
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> Self:
        """Begin."""
        self._client.__enter__()
        self._items = self._client.stranger.prepare(500)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """End."""
        self._end.set()
        self._thread.join()
        self._client.__exit__()

    def _run(self) -> None:
        # What a busy computer has missed is not made up for.
        while not self._end.wait(FLOOD_PERIOD):
            for _ in range(round(FLOOD * FLOOD_PERIOD)):
                publisher, data = self._items[self.messages % len(self._items)]
                publisher.publish(data)
                self.messages += 1


def measure_page(bench: Bench) -> Iterator[Figure]:
    """Stop a rig by its page in a real browser, with nine tabs open, while hits are struck."""
    try:
        from playwright.sync_api import sync_playwright
    except ModuleNotFoundError:
        raise NotHereError("the browser's hands, playwright, are not installed") from None
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        raise NotHereError("there is no browser: on Debian, apt-get install chromium")
    log = bench.folder / "log"
    with RigProcesses(log) as processes:
        processes.start_command(
            "up", "--output", str(bench.folder / "run"), "--no-visualizer",
            "--page", "--set", "page.port=0",
        )  # fmt: skip
        processes.wait_until(lambda: "ready: " in log.read_text("utf-8"), "no rig is ready")
        text = log.read_text("utf-8")
        link = _find(r"the page is at (\S+)", text)
        number, campaign = (
            int(_find(rf"{name} started \(pid=(\d+)\)", text)) for name in ("page", "campaign")
        )
        with sync_playwright() as playwright:
            started = playwright.chromium.launch(
                executable_path=browser, args=["--no-sandbox", "--disable-gpu"]
            )
            context = started.new_context()
            tabs = [context.new_page() for _ in range(TABS)]
            loads = [_load(tab, link) for tab in tabs]
            yield Figure("page, first load", loads, "ms", most=LONGEST_FIRST_LOAD)
            yield from _measure_stops(bench, tabs, campaign)
            for tab in tabs[5:]:
                tab.close()
            with RigClient("watcher") as watcher:
                published: dict[int, float] = {}
                watcher.listen(interfaces.IMPACT, lambda hit: _note_time(published, hit.value))
                tabs[0].evaluate(WATCH_VERDICTS)
                load = _measure_load(tabs[0], psutil.Process(number), watcher)
                seen = dict(tabs[0].evaluate("window.seen"))
            times = [at - published[record] for record, at in seen.items() if record in published]
            yield Figure("verdict to page", times, "ms", "five pages", most=LONGEST_VERDICT)
            yield Figure("page's node, five pages, hits struck", load, "cores", most=MOST_LOAD)
            growth = _measure_growth(tabs[0], psutil.Process(number))
            yield Figure("page's node grows, hits struck", growth, "MB/min", most=MOST_GROWTH)
            started.close()


def _measure_stops(bench: Bench, tabs: list[Any], campaign: int) -> Iterator[Figure]:
    """Stop with nothing else to do, with acts under way that nobody answers to, and in a flood."""
    times = list(_stop_often(tabs[0]))
    yield from _report_stops("click to STOPPED on the page", times, f"{TABS} tabs open")
    _start_campaign(tabs[0])
    os.kill(campaign, signal.SIGSTOP)
    try:
        for tab in tabs[:UNDER_WAY]:
            tab.locator("form[action=pause] button").click()
        note = f"{TABS} tabs, {UNDER_WAY} acts without an answer"
        times = list(_stop_often(tabs[0], 10))
        yield from _report_stops("click to STOPPED, acts under way", times, note)
    finally:
        os.kill(campaign, signal.SIGCONT)
    _end_campaign(tabs[0])
    _start_campaign(tabs[0])
    begin = time.perf_counter()
    with Flood(bench.extent.seed) as flood:
        times = list(_stop_often(tabs[0]))
    rate = flood.messages / (time.perf_counter() - begin)
    note = f"{TABS} tabs, {rate:.0f} foreign messages a second"
    yield from _report_stops("click to STOPPED, flooded", times, note)
    _end_campaign(tabs[0])


def _report_stops(name: str, times: list[float], note: str) -> Iterator[Figure]:
    yield Figure(name, times, "ms", note, most=LONGEST_MEDIAN)
    tail = float(np.percentile(times, 99))
    yield Figure("99th percentile of it", tail, "ms", most=LONGEST_TAIL)


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


def _stop_often(tab: Any, stops: int = STOPS) -> Iterator[float]:
    for _ in range(stops):
        yield float(tab.evaluate(MEASURE_STOP))
        tab.get_by_role("button", name="Reset the stop").click()
        tab.locator("#moment form[action=arm]").wait_for()


def _start_campaign(tab: Any) -> None:
    if tab.locator("#moment form[action=arm]").is_visible():
        tab.locator("#moment button").click()
        tab.locator("#hammer form[action=disarm]").wait_for()
    form = tab.locator("#start form")
    form.wait_for()
    form.locator("input[name=impacts]").fill("1000")
    form.locator("button.main").click()
    tab.locator("form[action=end] button").wait_for()


def _note_time(published: dict[int, float], hit: HitResults) -> None:
    published.setdefault(hit.record, time.time() * 1e3)


def _measure_load(
    tab: Any, node: psutil.Process, watcher: RigClient, seconds: float = 10.0
) -> float:
    """Return the processor time of the page's node while a campaign runs [cores]."""
    _start_campaign(tab)
    before, begin = sum(node.cpu_times()[:2]), time.perf_counter()
    while time.perf_counter() < begin + seconds:
        watcher.spin_until(lambda: False, 0.1)
        tab.wait_for_timeout(1.0)
    used = sum(node.cpu_times()[:2]) - before
    duration = time.perf_counter() - begin
    _end_campaign(tab)
    return float(used / duration)


def _measure_growth(tab: Any, node: psutil.Process) -> float:
    """Return by how much the page's node grows while a campaign runs [MB/min]."""
    _start_campaign(tab)
    tab.wait_for_timeout(1e3 * SETTLING_TIME)
    before = node.memory_info().rss
    tab.wait_for_timeout(1e3 * GROWTH_TIME)
    grown = node.memory_info().rss - before
    _end_campaign(tab)
    return float(grown / 1e6 / GROWTH_TIME * 60.0)


def _end_campaign(tab: Any) -> None:
    tab.evaluate("document.querySelector('form[action=end]').requestSubmit()")
    tab.locator("#start form").wait_for()
