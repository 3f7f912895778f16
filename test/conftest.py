"""What all tests share: generated input that is the same each time, and a struck campaign."""

# ruff: noqa: E402
from impact_rig.configuration.processes import use_one_thread

use_one_thread()  # before numpy is imported, which reads it once

import gc
import math
import os
import re
import shutil
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import hypothesis
import pytest

from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import PAPER_SETUP, RigSetup
from impact_rig.core.session import Session
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import FaultPlan, VirtualRig, VirtualRigSettings
from impact_rig.results.campaign import Results, results_from_session

if pytest.version_tuple < (8,):  # Ubuntu 24.04's takes this folder for Python's own `test`
    sys.modules["test"] = ModuleType("test")
    sys.modules["test"].__path__ = [str(Path(__file__).parent)]

hypothesis.settings.register_profile("rig", derandomize=True, deadline=None, max_examples=40)
hypothesis.settings.load_profile("rig")

# Processes inherit a signal that is ignored, as `nohup` and CI runners ignore them, but not a
# handler: this session goes on being deaf to it, and what its tests start is not.
for number in (signal.SIGINT, signal.SIGHUP):
    if signal.getsignal(number) == signal.SIG_IGN:
        signal.signal(number, lambda *_: None)


OPTIONAL = {
    "google", "h5py", "lvm_read", "mcap_ros2", "mujoco", "nptdms", "openpyxl", "pyarrow", "pyuff",
}  # fmt: skip
"""Libraries that package.xml does not name: tests that import one are skipped without it."""


@contextmanager
def skip_where_missing():
    """Skip what imports an optional library that is missing."""
    try:
        yield
    except (ImportError, pytest.Collector.CollectError) as error:
        missing = getattr(error.__cause__ or error, "name", None) or ""
        if missing.partition(".")[0] in OPTIONAL:
            pytest.skip(f"{missing} is not installed", allow_module_level=True)
        raise


class OptionalModule(pytest.Module):
    """A file of tests that may import an optional library."""

    def collect(self):
        """Return its tests."""
        with skip_where_missing():
            return super().collect()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup():
    """Make the fixtures of a test."""
    with skip_where_missing():
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call():
    """Run a test."""
    with skip_where_missing():
        return (yield)


def pytest_pycollect_makemodule(module_path, parent):
    """Return a file of tests."""
    return OptionalModule.from_parent(parent, path=module_path)


Strike = Callable[..., Results]


def strike_samples(
    names: Iterable[str] = PAPER_SETUP.samples.names,
    *,
    setup: RigSetup = PAPER_SETUP,
    impacts: int = 2,
    fault_probability: float = 0.0,
    seed: int = 1,
    plant: Plant = Plant.PUBLISHED,
) -> Results:
    """Strike every sample a number of times, good hits or bad."""
    settings = VirtualRigSettings(plant, seed=seed, faults=FaultPlan(fault_probability))
    rig, session, faults, record = VirtualRig(setup, settings), Session(setup), {}, 0
    for name in names:
        for impact in range(1, impacts + 1):
            record += 1
            hit = rig.strike(HitLabel(name, record, impact))
            faults[record] = tuple(fault.value for fault in hit.faults)
            for block in hit.split(5000, 0):
                session.feed(block)
    return results_from_session(session.estimate_all(), faults)


@pytest.fixture(scope="session")
def strike() -> Strike:
    """Return the function that strikes samples."""
    return strike_samples


@pytest.fixture(scope="session")
def results() -> Results:
    """Return the paper's campaign with two hits each."""
    return strike_samples()


BROWSER = shutil.which("chromium") or shutil.which("google-chrome")


@pytest.fixture(scope="module")
def browser():
    """Return a browser without a screen."""
    if BROWSER is None:
        pytest.skip("no browser looks at the page: on Debian, apt-get install chromium")
    options = [
        "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
        "--disable-background-networking", "--disable-component-update", "--disable-sync",
    ]  # fmt: skip
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=BROWSER, args=options)
        yield started
        started.close()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    """Return how many tests run at once: half of their time they wait for nodes and programs."""
    cores = len(os.sched_getaffinity(0))
    return int(os.environ.get("PYTEST_XDIST_AUTO_NUM_WORKERS", math.ceil(1.5 * cores)))


def pytest_collection_modifyitems(items):
    """Begin with the files that take long: with one of them at the end, one core has no work."""
    items.sort(key=lambda item: item.path.parent.name not in ("test", "integration"))


def pytest_collection_finish():
    """Leave what was loaded and collected out of every later search for garbage: it stays."""
    gc.freeze()


def pytest_terminal_summary(terminalreporter):
    """Say last what was left out on this machine, and which Debian packages would bring it in."""
    reasons = Counter(
        report.longrepr[2].removeprefix("Skipped: ")
        for report in terminalreporter.stats.get("skipped", [])
    )
    if not reasons:
        return
    terminalreporter.section("left out on this machine")
    for reason, count in sorted(reasons.items()):
        terminalreporter.line(f"{count:5d}  {reason}")
    found = (re.findall(r"apt-get install ([\w. -]+)", reason) for reason in reasons)
    if packages := sorted({name for lists in found for names in lists for name in names.split()}):
        terminalreporter.line(f"to bring it in: sudo apt-get install {' '.join(packages)}")
