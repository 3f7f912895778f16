"""The page at the rig: real nodes, a by-hand holder, and a browser that clicks."""

import contextlib
import os
import re
import shutil
import signal
import subprocess

import pytest
from impact_rig_msgs.srv import Act

from impact_rig.cli.campaign import UNATTENDED_PAUSE
from impact_rig.configuration.rig_file import read_template
from impact_rig.nodes import interfaces
from impact_rig.nodes.client import RigClient
from impact_rig.page.server import Address, PageServer
from impact_rig.page.view import make_view
from impact_rig.recordings.run import Run
from impact_rig.recordings.schemas import decode_message
from impact_rig.status.rig_status import RigStatus
from impact_rig.testing import use_own_domain

from .conftest import PATIENCE, start_command

sync_api = pytest.importorskip("playwright.sync_api")
BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(
    BROWSER is None, reason="no browser looks at the page: on Debian, apt-get install chromium"
)
MILLISECONDS = 1000 * PATIENCE
STRANGE = "<script>window.pwned = 1</script>"
"""Name of a sample."""
RIG_FILE = read_template().replace('"brass small"', f'"{STRANGE}"') + (
    '\n[holder]\ndriver = "manual"\npatience = "60 s"\n'
)


def wait_for_line(process, word):
    """Return what stands behind a word in a line that a process prints."""
    said = []
    for line in process.stdout:
        if word in line:
            return line.partition(word)[2].strip()
        said.append(line)
    raise AssertionError(f"it ended and never said {word!r}, but {''.join(said)}")


class RunningRig:
    """A rig with a page."""

    def __init__(self, folder):
        (folder / "rig.toml").write_text(RIG_FILE, "utf-8")
        self.folder = folder / "run"
        self.process = self.start(
            "up", "--rig-file", folder / "rig.toml", "--output", self.folder, "--no-visualizer",
            "--page", "--set", "page.port=0", "--set", "hammer.swing_time=1.0",
        )  # fmt: skip
        self.page_process = None
        lines = []
        for line in self.process.stdout:
            lines.append(line)
            if "ready: " in line:
                break
        text = "".join(lines)
        self.link = re.search(r"the page is at (\S+)", text)[1]
        self.page_pid = int(re.search(r"page started \(pid=(\d+)\)", text)[1])

    def start(self, *words):
        return start_command(*words, stderr=subprocess.STDOUT)

    def stop(self):
        for process in filter(None, (self.page_process, self.process)):
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=PATIENCE)


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    with use_own_domain():
        running = RunningRig(tmp_path_factory.mktemp("rig"))
        yield running
        running.stop()


@pytest.fixture(scope="module")
def browser():
    options = [
        "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
        "--disable-background-networking", "--disable-component-update", "--disable-sync",
    ]  # fmt: skip
    with sync_api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=BROWSER, args=options)
        yield started
        started.close()


@pytest.fixture
def open_page(rig, browser):
    """Return a function that opens the page in a browser of its own."""
    with contextlib.ExitStack() as opened:

        def open_one(**options):
            context = browser.new_context(**options)
            opened.callback(context.close)
            context.set_default_timeout(MILLISECONDS)
            page = context.new_page()
            page.goto(rig.link)
            return page

        yield open_one


@pytest.fixture
def page(open_page):
    """Return the page of a rig in which no campaign runs, before and after."""
    shown = open_page()
    sync_api.expect(shown.locator("#start")).to_be_visible(timeout=MILLISECONDS)
    yield shown
    if shown.locator("form[action=end] button").is_visible():
        shown.locator("form[action=end] button").click()
    with RigClient("cleaner") as client:
        client.call(Act, interfaces.RESET_HAMMER, Act.Request(), PATIENCE)
    sync_api.expect(shown.locator("#start")).to_be_visible(timeout=MILLISECONDS)


def say(page, text):
    """Wait until the sentence begins with a text."""
    sentence = sync_api.expect(page.locator("#say b"))
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


def test_a_campaign_is_run_by_clicks_alone_and_a_second_page_sees_it(page, open_page):
    other = open_page(viewport={"width": 390, "height": 800})
    start(page, "steel small", STRANGE)
    say(page, "MOUNT steel small")
    say(other, "MOUNT steel small")
    page.get_by_role("button", name="steel small is mounted").click()
    say(page, "RELEASE NOW")
    assert re.search(r"· \d+ s", page.locator("#say b").inner_text())
    say(other, f"MOUNT {STRANGE}")
    # From the phone.
    other.get_by_role("button", name="is mounted").click()
    say(page, "DONE")
    sync_api.expect(page.locator("#results tbody tr")).to_have_count(2)
    assert "steel small" in page.locator("#results tbody").inner_text()
    sync_api.expect(page.locator("#verdict")).to_contain_text("accepted")
    drawn = "canvas => canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height)"
    page.wait_for_function(
        f"() => ({drawn})(document.getElementById('contact')).data.some(v => v)"
    )
    assert page.evaluate("window.pwned") is None
    assert other.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_stop_while_a_release_is_asked_for_then_reset_arm_and_go_on(page):
    start(page, "steel small", ask=False)
    say(page, "RELEASE NOW")
    # By hand the hammer counts as swinging from now on.
    sync_api.expect(page.locator("#hammer")).to_contain_text("swinging")
    page.keyboard.press(" ")
    say(page, "STOPPED")
    sync_api.expect(page.locator("#stopped")).to_contain_text("since")
    page.get_by_role("button", name="Reset the stop").click()
    say(page, "PAUSED")
    page.get_by_role("button", name="Arm").click()
    say(page, "DONE")
    # What was struck after the stop did not count.
    sync_api.expect(page.locator("#hits tbody")).to_contain_text("disarmed")


def test_the_inputs_are_shown_and_a_trial_hit_suggests_and_does_not_count(page):
    monitor = page.locator("#monitor")
    page.get_by_role("button", name="Show the inputs").click()
    rows = monitor.locator("tbody tr")
    sync_api.expect(rows).to_have_count(2)
    sync_api.expect(rows.first).to_contain_text("2000.0 m/s²")
    start(page, "steel small", STRANGE, ask=False, button="Trial hit")
    say(page, "RELEASE NOW")
    say(page, "TRIAL HIT")
    sync_api.expect(page.locator("#numbers")).to_contain_text("momenta")
    sync_api.expect(monitor).to_contain_text(re.compile(r"Act level that suits: \d+"))
    # The next campaign knows nothing of it.
    start(page, "steel small", ask=False)
    say(page, "DONE")
    sync_api.expect(page.locator("#hits tbody tr")).to_have_count(1)


def test_a_pause_disarms_and_the_campaign_goes_on(page):
    start(page, "steel small", ask=False)
    say(page, "RELEASE NOW")
    page.keyboard.press("p")
    say(page, "PAUSED")
    sync_api.expect(page.locator("#hammer")).to_contain_text("no: ")
    page.get_by_role("button", name="Go on").click()
    say(page, "DONE")


def test_a_pause_at_the_page_of_a_demo_lasts_longer_than_one_that_nobody_sees(browser, tmp_path):
    # Not in the domain of the module's rig, beside which no other may be.
    process = start_command(
        "demo", "--page", "--sample", "steel small", "--impacts", "5000",
        "--output", tmp_path / "run", stderr=subprocess.STDOUT, env={"ROS_DOMAIN_ID": None},
    )  # fmt: skip
    page = browser.new_page()
    try:
        page.goto(wait_for_line(process, "the page is at "))
        hits = page.locator("#hits tbody tr")
        sync_api.expect(hits.first).to_be_visible(timeout=MILLISECONDS)
        page.keyboard.press("p")
        say(page, "PAUSED")
        before = hits.count()
        page.wait_for_timeout(1000.0 * (UNATTENDED_PAUSE + 2.0))
        say(page, "PAUSED")
        assert hits.count() == before
        page.get_by_role("button", name="Go on").click()
        sync_api.expect(hits.nth(before)).to_be_visible(timeout=MILLISECONDS)
    finally:
        page.close()
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=PATIENCE)
    assert "impact-rig campaign --resume" in output


def test_a_hit_is_rejected_by_hand_struck_again_and_the_verdict_undone(page):
    start(page, "steel small", STRANGE)
    page.get_by_role("button", name="steel small is mounted").click()
    say(page, f"MOUNT {STRANGE}")
    hits = page.locator("#hits tbody tr")
    hits.last.locator("summary").click()
    hits.last.get_by_label("reason").fill("the wax was loose")
    hits.last.get_by_role("button", name="Reject it").click()
    sync_api.expect(page.locator("#answer")).to_contain_text("give a reason and a name")
    page.locator("input[name=who]").fill("Anna")
    page.get_by_role("button", name="Keep it").click()
    page.reload()
    hits.last.locator("summary").click()
    hits.last.get_by_label("reason").fill("the wax was loose")
    hits.last.get_by_role("button", name="Reject it").click()
    sync_api.expect(hits.last).to_contain_text("left out by hand")
    sync_api.expect(hits.last).to_contain_text("the wax was loose")
    page.get_by_role("button", name="is mounted").click()
    # The first sample lacks a hit again.
    say(page, "MOUNT steel small")
    hits.last.locator("details").evaluate("item => { item.open = true }")
    hits.last.get_by_role("button", name="Undo").click()
    sync_api.expect(hits.last.locator("td").nth(2)).to_have_text("accepted")


@pytest.mark.parametrize("width", [390, 1280])
def test_stop_stays_in_sight_wherever_the_page_is_scrolled_to(page, width):
    page.set_viewport_size({"width": width, "height": 600})
    page.locator("#health").scroll_into_view_if_needed()
    sync_api.expect(page.locator("#stop button")).to_be_in_viewport()


def test_a_name_and_a_note_stand_in_the_recording(page, rig):
    page.locator("input[name=who]").fill("Anna <b>")
    page.get_by_role("button", name="Keep it").click()
    page.reload()
    note = page.get_by_label("note on the run")
    note.fill("the wax is new")
    note.press("Enter")
    sync_api.expect(note).to_have_value("")
    # It is on the page, too.
    note.blur()
    sync_api.expect(page.locator("#hits ul")).to_contain_text("Anna <b>: the wax is new")

    def read_notes():
        run = Run(rig.folder)
        return [decode_message(raw).data for raw in run.read_messages({"std_msgs/msg/String"})]

    with RigClient("reader") as client:
        wanted = "at the page, Anna <b>: the wax is new"
        assert client.spin_until(lambda: wanted in read_notes(), PATIENCE)


def test_every_act_works_without_a_script(page, open_page):
    plain = open_page(java_script_enabled=False)
    plain.locator("#stop button").click()
    sync_api.expect(plain.locator("#answer")).to_contain_text("stopped")
    say(page, "STOPPED")
    plain.get_by_role("button", name="Reset the stop").click()
    sync_api.expect(plain.locator("#answer")).to_contain_text("the emergency stop is ended")


def find_page(rig):
    return rig.page_process.pid if rig.page_process else rig.page_pid


def wait_for_silence(page, *, ends=False):
    expected = sync_api.expect(page.locator("html"))
    wait = expected.not_to_have_class if ends else expected.to_have_class
    wait(re.compile("silent"), timeout=MILLISECONDS)


def test_a_page_that_is_cut_off_greys_and_a_stop_that_was_late_is_shown(page, rig):
    os.kill(find_page(rig), signal.SIGSTOP)
    try:
        wait_for_silence(page)
        page.locator("#stop button").click()
        sync_api.expect(page.locator("#stopped")).to_have_text("NOT CONFIRMED: use the switch")
    finally:
        os.kill(find_page(rig), signal.SIGCONT)
    wait_for_silence(page, ends=True)
    say(page, "STOPPED")
    sync_api.expect(page.locator("#stopped")).to_contain_text("since")


def test_other_pages_of_the_same_browser_see_nothing_and_change_nothing(page, rig, browser):
    port = rig.link.rpartition(":")[2].strip("/")
    evil = browser.new_context().new_page()
    assert evil.goto(f"http://localhost:{port}/").status == 421
    stop = f"<form method=post action='{rig.link}stop'><button>free holidays</button></form>"
    evil.route("http://evil.example/", lambda route: route.fulfill(
        body=stop, content_type="text/html"
    ))  # fmt: skip
    evil.goto("http://evil.example/")
    with evil.expect_response(lambda answer: answer.url.endswith("/stop")) as refused:
        evil.get_by_role("button").click()
    assert refused.value.status == 403
    evil.goto("http://evil.example/")
    opens = evil.evaluate(
        f"""() => new Promise((resolve) => {{
          const socket = new WebSocket("ws://127.0.0.1:{port}/live");
          socket.onopen = () => resolve(true);
          socket.onerror = () => resolve(false);
        }})"""
    )
    evil.context.close()
    assert not opens
    assert not page.locator("#say b").inner_text().startswith("STOPPED")


def test_elsewhere_the_link_with_its_token_opens_the_page_and_no_other(browser):
    with PageServer(Address("0.0.0.0"), {}) as server:
        server.show(make_view(RigStatus()))
        stranger, guest = browser.new_context().new_page(), browser.new_context().new_page()
        bare = server.link.partition("?")[0]
        assert stranger.goto(bare).status == 403
        assert stranger.goto(f"{bare}?token=wrong").status == 403
        guest.goto(server.link)
        # Kept as a cookie, and no longer in the address.
        assert guest.url == bare
        sync_api.expect(guest.locator("html")).to_have_class(re.compile("live"))
        assert guest.goto(bare).status == 200
        for opened in (stranger, guest):
            opened.context.close()


def test_a_page_without_its_server_greys_says_so_and_comes_back(page, rig):
    port, before = rig.link.rpartition(":")[2].strip("/"), page.locator("#say b").inner_text()
    os.kill(find_page(rig), signal.SIGKILL)
    wait_for_silence(page)
    page.keyboard.press(" ")
    sync_api.expect(page.locator("#answer")).to_have_text("NOT CONFIRMED: use the switch")
    # The rig goes on without its page.
    assert rig.process.poll() is None
    rig.page_process = rig.start("page", "--port", port)
    wait_for_line(rig.page_process, "the page is at")
    wait_for_silence(page, ends=True)
    say(page, before)
