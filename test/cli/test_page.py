"""The page at the rig: real nodes, a by-hand holder, and a browser that clicks."""

import re
import signal
import subprocess

import pytest

from impact_rig.cli.campaign import UNATTENDED_PAUSE
from impact_rig.configuration.rig_file import read_template
from impact_rig.nodes.client import RigClient
from impact_rig.recordings.run import Run
from impact_rig.recordings.schemas import decode_message

from .conftest import PATIENCE, start_command
from .page_rig import (
    MILLISECONDS,
    needs_browser,
    run_rig,
    say,
    start,
    sync_api,
    wait_for_line,
)

pytestmark = needs_browser
STRANGE = "<script>window.pwned = 1</script>"
"""Name of a sample."""
RIG_FILE = read_template().replace('"brass small"', f'"{STRANGE}"') + (
    '\n[holder]\ndriver = "manual"\npatience = "60 s"\n'
)


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rig")
    with run_rig(folder, RIG_FILE, "hammer.swing_time=1.0") as running:
        yield running


def test_a_campaign_is_run_by_clicks_alone_and_a_second_page_sees_it(page, open_page):
    other = open_page(viewport={"width": 390, "height": 800})
    start(page, "steel small", STRANGE)
    say(page, "MOUNT steel small")
    say(other, "MOUNT steel small")
    page.get_by_role("button", name="steel small is mounted").click()
    say(page, "PULL BACK, then RELEASE")
    assert re.search(r"· \d+ s", page.locator("#say b").inner_text())
    # Computed hits beside a holder that is real: somebody strikes.
    sync_api.expect(page.locator("#banner")).to_have_text("MEASURED")
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
    say(page, "PULL BACK, then RELEASE")
    # By hand the hammer counts as swinging from now on.
    sync_api.expect(page.locator("#hammer")).to_contain_text("swings")
    page.keyboard.press(" ")
    say(page, "STOPPED")
    sync_api.expect(page.locator("#stopped")).to_contain_text("by somebody at the page")
    page.get_by_role("button", name="Reset the stop").click()
    say(page, "ARM FIRST")
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
    say(page, "PULL BACK, then RELEASE")
    say(page, "TRIAL HIT")
    sync_api.expect(page.locator("#numbers")).to_contain_text("momenta")
    sync_api.expect(monitor).to_contain_text(re.compile(r"Trigger level that suits: \d+"))
    # The next campaign knows nothing of it.
    start(page, "steel small", ask=False)
    say(page, "DONE")
    sync_api.expect(page.locator("#hits tbody tr")).to_have_count(1)


def test_a_pause_disarms_and_the_campaign_goes_on(page):
    start(page, "steel small", ask=False)
    say(page, "PULL BACK, then RELEASE")
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
    sync_api.expect(page.locator("#notes")).to_contain_text(
        "Anna <b> at the page (127.0.0.1): the wax is new"
    )

    def read_notes():
        run = Run(rig.folder)
        return [decode_message(raw).data for raw in run.read_messages({"std_msgs/msg/String"})]

    with RigClient("reader") as client:
        wanted = "Anna <b> at the page (127.0.0.1): the wax is new"
        assert client.spin_until(lambda: wanted in read_notes(), PATIENCE)


def test_every_act_works_without_a_script(page, open_page):
    plain = open_page(java_script_enabled=False)
    plain.locator("#stop button").click()
    sync_api.expect(plain.locator("#answer")).to_contain_text("stopped")
    say(page, "STOPPED")
    plain.get_by_role("button", name="Reset the stop").click()
    sync_api.expect(plain.locator("#answer")).to_contain_text("the emergency stop is ended")


def test_other_pages_of_the_same_browser_see_nothing_and_change_nothing(page, rig, browser):
    port = rig.port
    evil = browser.new_context().new_page()
    assert evil.goto(f"http://evil.localhost:{port}/").status == 421
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


def test_up_ends_with_a_sentence_where_the_page_cannot_be_served(tmp_path):
    wrong = tmp_path / "wrong.pem"
    wrong.write_text("no certificate")
    for setting, told in (
        (f"certificate={wrong}", "certificate .*wrong.pem cannot be used"),
        ("address=192.0.2.1", "cannot listen at 192.0.2.1:8000"),
    ):
        process = start_command(
            "up", "--output", tmp_path / setting[:3], "--no-visualizer", "--page",
            "--set", f"page.{setting}", stderr=subprocess.STDOUT,
            env={"ROS_DOMAIN_ID": None, "XDG_STATE_HOME": str(tmp_path)},
        )  # fmt: skip
        output, _ = process.communicate(timeout=PATIENCE)
        assert process.returncode
        assert re.search(told, output)
        assert "Traceback" not in output
        assert "ready" not in output
