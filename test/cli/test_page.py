"""The page at the rig: real nodes, a by-hand holder, and a browser that clicks."""

import re
import signal
import subprocess

import pytest

from impact_rig.configuration.rig_file import read_template

from .conftest import PATIENCE, start_command, start_python
from .page_rig import MILLISECONDS, expect, give_name, press, run_rig, say, start, wait_for_line

STRANGE = "<script>window.pwned = 1</script>"
"""Name of a sample."""
RIG_FILE = read_template().replace('"brass small"', f'"{STRANGE}"') + (
    '\n[holder]\ndriver = "manual"\npatience = "60 s"\n'
)


@pytest.fixture(scope="module")
def rig(browser, tmp_path_factory):
    with run_rig(tmp_path_factory.mktemp("rig"), RIG_FILE, "hammer.swing_time=1.0") as running:
        yield running


def test_a_campaign_is_run_by_clicks_alone_and_a_second_page_sees_it(page, open_page):
    other = open_page(viewport={"width": 390, "height": 800})
    start(page, "steel small", STRANGE, ask=True)
    say(page, "MOUNT steel small")
    say(other, "MOUNT steel small")
    press(page, "steel small is mounted")
    say(page, "PULL BACK, then RELEASE")
    assert re.search(r"· \d+ s", page.locator("#say b").inner_text())
    # Rule 9: computed hits beside a holder that is real: somebody strikes.
    expect(page.locator("#banner")).to_have_text("MEASURED")
    say(other, f"MOUNT {STRANGE}")
    # From the phone.
    press(other, "is mounted")
    say(page, "DONE")
    expect(page.locator("#results tbody tr")).to_have_count(2)
    assert "steel small" in page.locator("#results tbody").inner_text()
    expect(page.locator("#verdict")).to_contain_text("accepted")
    drawn = "canvas => canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height)"
    page.wait_for_function(
        f"() => ({drawn})(document.getElementById('contact')).data.some(v => v)"
    )
    assert page.evaluate("window.pwned") is None


def test_a_stop_while_a_release_is_asked_for_then_the_campaign_goes_on(page):
    start(page, "steel small")
    say(page, "PULL BACK, then RELEASE")
    # By hand the hammer counts as swinging from now on.
    expect(page.locator("#hammer")).to_contain_text("swings")
    page.keyboard.press(" ")
    say(page, "STOPPED")
    press(page, "Reset the stop")
    say(page, "ARM FIRST")
    press(page, "Arm")
    say(page, "DONE")
    # What was struck after the stop did not count.
    expect(page.locator("#hits tbody")).to_contain_text("disarmed")


def test_the_inputs_are_shown_and_a_trial_hit_suggests_and_does_not_count(page):
    monitor = page.locator("#monitor")
    press(page, "Show the inputs")
    rows = monitor.locator("tbody tr")
    expect(rows).to_have_count(2)
    expect(rows.first).to_contain_text("2000.0 m/s²")
    start(page, "steel small", STRANGE, button="Trial hit")
    say(page, "PULL BACK, then RELEASE")
    say(page, "TRIAL HIT")
    expect(page.locator("#numbers")).to_contain_text("momenta")
    expect(monitor).to_contain_text(re.compile(r"Trigger level that suits: \d+"))
    # The next campaign knows nothing of it.
    start(page, "steel small")
    say(page, "DONE")
    expect(page.locator("#hits tbody tr")).to_have_count(1)


HASTY = """
import impact_rig.cli.campaign as campaign
from impact_rig.cli.main import cli
campaign.UNATTENDED_PAUSE = 0.5
cli()
"""
"""The command line, where a pause that nobody sees ends soon."""


def test_a_pause_at_the_page_of_a_demo_lasts_longer_than_one_that_nobody_sees(browser, tmp_path):
    # Not in the domain of the module's rig, beside which no other may be.
    process = start_python(
        "-c", HASTY, "demo", "--page", "--sample", "steel small", "--impacts", "5000",
        "--output", tmp_path / "run", stderr=subprocess.STDOUT, env={"ROS_DOMAIN_ID": None},
    )  # fmt: skip
    page = browser.new_page()
    try:
        page.goto(re.search(r"at (http\S+)", wait_for_line(process, "the page is at "))[1])
        hits = page.locator("#hits tbody tr")
        expect(hits.first).to_be_visible(timeout=MILLISECONDS)
        page.keyboard.press("p")
        say(page, "PAUSED")
        before = hits.count()
        page.wait_for_timeout(1500.0)
        say(page, "PAUSED")
        assert hits.count() == before
        press(page, "Go on")
        expect(hits.nth(before)).to_be_visible(timeout=MILLISECONDS)
    finally:
        page.close()
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=PATIENCE)
    assert re.search("impact-rig up --resume .* then impact-rig campaign --resume", output)


def test_a_hit_is_rejected_by_hand_with_a_name_and_taken_back_by_a_key_each(page):
    start(page, "steel small", STRANGE, ask=True)
    press(page, "steel small is mounted")
    say(page, f"MOUNT {STRANGE}")
    row = page.locator("#rows tr").first
    row.locator("summary").click()
    row.get_by_label("reason").fill("the wax was loose")
    press(row, "Reject it")
    expect(page.locator("#answer")).to_contain_text("give a reason and a name")
    give_name(page, "Anna")
    page.keyboard.press("3")  # the list is closed
    page.keyboard.press("r")
    page.keyboard.press("3")
    expect(row).to_contain_text("left out by hand, by Anna: struck twice")
    # The first sample lacks a hit again.
    say(page, "MOUNT steel small")
    page.keyboard.press("u")
    expect(row.locator("td").nth(2)).to_have_text("accepted")
    say(page, f"MOUNT {STRANGE}")
    press(page, "is mounted")
    say(page, "DONE")
    expect(page.locator("#end")).to_contain_text("results.json")
    expect(page.locator("#end")).to_contain_text("impact-rig report")


def test_every_act_works_without_a_script(page, open_page):
    plain = open_page(java_script_enabled=False)
    plain.locator("#stop button").click()
    expect(plain.locator("#answer")).to_contain_text("stopped")
    say(page, "STOPPED")
    press(plain, "Reset the stop")
    expect(plain.locator("#answer")).to_contain_text("the emergency stop is ended")


def test_what_is_typed_focused_and_open_survives_an_update(page):
    start(page, "steel small", STRANGE, ask=True)
    press(page, "steel small is mounted")
    say(page, f"MOUNT {STRANGE}")
    page.locator("#rows summary").click()
    note = page.get_by_label("note on the hit")
    note.fill("half a sent")
    page.evaluate("window.note = document.querySelector('#rows details')")
    page.locator("#moment button").click()
    note.focus()
    say(page, "DONE")
    expect(page.locator("#rows tr")).to_have_count(2)
    kept = page.locator("#rows tr").last
    assert kept.locator("details").evaluate("item => item.open && item === window.note")
    expect(kept.get_by_label("note on the hit")).to_have_value("half a sent")
    expect(kept.get_by_label("note on the hit")).to_be_focused()


def check_look(page):
    """Assert that axe-core finds nothing serious, nothing is cut off, and STOP is in sight."""
    from axe_playwright_python.sync_playwright import Axe

    for look, width, height in (("light", 1920, 1080), ("dark", 390, 800)):
        page.emulate_media(color_scheme=look)
        page.set_viewport_size({"width": width, "height": height})
        serious = [
            (it["id"], [node["html"] for node in it["nodes"]][:3])
            for it in Axe().run(page).response["violations"]
            if it["impact"] in ("serious", "critical")
        ]
        assert not serious
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        page.locator("#health").scroll_into_view_if_needed()
        for button in page.locator("#stop button, #moment button:visible").all():
            expect(button).to_be_in_viewport()


def test_everybody_can_use_the_page_in_each_state(page, rig):
    check_look(page)
    start(page, "steel small", ask=True)
    say(page, "MOUNT")
    check_look(page)
    press(page, "is mounted")
    say(page, "DONE")
    check_look(page)
    with rig.frozen("page"):
        say(page, "NO CONNECTION")
        check_look(page)
    page.keyboard.press("Escape")
    say(page, "STOPPED")
    check_look(page)
    press(page, "Reset the stop")
    say(page, "DONE. ARM FIRST")
    check_look(page)


def test_up_ends_with_a_sentence_where_the_page_cannot_be_served(tmp_path):
    process = start_command(
        "up", "--output", tmp_path / "run", "--no-visualizer", "--page",
        "--set", "page.address=192.0.2.1", stderr=subprocess.STDOUT,
        env={"ROS_DOMAIN_ID": None, "XDG_STATE_HOME": str(tmp_path)},
    )  # fmt: skip
    output, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode
    assert "cannot listen at 192.0.2.1:8000" in output
    assert "Traceback" not in output
    assert "ready" not in output
