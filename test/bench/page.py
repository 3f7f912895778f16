"""The page at the rig: how soon a stop and a verdict are shown, and what five pages cost."""

import os
import re
import shutil
import signal
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import psutil

from bench.measure import Bench, Figure, NotHereError
from bench.rig_processes import RigProcesses
from impact_rig.core.given.errors import RigError
from impact_rig.nodes import interfaces
from impact_rig.nodes.client import RigClient
from impact_rig.results.campaign import HitResults

STOPS = 40
TABS = 9
LONGEST_MEDIAN, LONGEST_TAIL = 20.0, 60.0  # [ms], median and 99th percentile, as asked for
UNDER_WAY = 6  # acts without an answer: as many as a browser has connections
MOST_GROWTH = 0.2  # [MB/min] of the page's node while hits are struck, as asked for
GROWTH_TIME, SETTLING_TIME = 120.0, 60.0  # [s]; until all is full that has a bound
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
            tabs[0].bring_to_front()
            yield Figure("page, first load", loads, "ms", most=LONGEST_FIRST_LOAD)
            yield from _measure_stops(tabs, campaign)
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


def _measure_stops(tabs: list[Any], campaign: int) -> Iterator[Figure]:
    """Stop with nothing else to do, and with acts under way that nobody answers to."""
    times = list(_stop_often(tabs[0]))
    yield from _report_stops("click to STOPPED on the page", times, f"{TABS} tabs open")
    _start_campaign(tabs[0])
    os.kill(campaign, signal.SIGSTOP)
    try:
        for tab in tabs[:UNDER_WAY]:
            tab.locator("form[action=pause] button").click()
        note = f"{TABS} tabs, {UNDER_WAY} acts without an answer"
        times = list(_stop_often(tabs[0]))
        yield from _report_stops("click to STOPPED, acts under way", times, note)
    finally:
        os.kill(campaign, signal.SIGCONT)
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


def _stop_often(tab: Any) -> Iterator[float]:
    for _ in range(STOPS):
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
