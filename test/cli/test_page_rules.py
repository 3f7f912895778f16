"""Who may move the hammer, and what the screen may say: real keys, a real browser, frozen nodes.

The numbers are those of the table in the page's README.
"""

import contextlib
import os
import re
import signal
import socket
import time

import psutil
import pytest
from impact_rig_msgs.srv import Act

from impact_rig.configuration.rig_file import read_template
from impact_rig.nodes import interfaces
from impact_rig.nodes.client import RigClient
from impact_rig.recordings.run import Run
from impact_rig.recordings.schemas import decode_message

from .conftest import PATIENCE
from .page_rig import (
    needs_browser,
    run_rig,
    say,
    start,
    sync_api,
)

pytestmark = needs_browser
expect = sync_api.expect


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """Return a rig whose hammer goes by itself, three seconds after its notice."""
    folder = tmp_path_factory.mktemp("rig")
    env = {"XDG_STATE_HOME": str(folder / "state")}
    with run_rig(
        folder, read_template(), "hammer.lead_time=3.0", "page.address=0.0.0.0", env=env
    ) as running:
        # By the loopback address: nothing leaves this computer.
        running.token = re.search(r"token=(\S+)", running.link)[1]
        running.link = f"http://127.0.0.1:{running.port}/?token={running.token}"
        yield running


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


def count_hits(page):
    return page.locator("#rows tr").count()


def wait_to_read(page):
    """Wait as long as a new sentence takes to be read."""
    page.wait_for_timeout(1100.0)


def ask_for(page, sample="steel small"):
    """Start a campaign, until its sample is asked for."""
    start(page, sample)
    say(page, f"MOUNT {sample}")


# 1. STOP shares nothing.


def test_rule_1_six_acts_under_way_delay_no_stop(page, rig):
    ask_for(page)
    # A browser has six connections to a server, for all of its tabs.
    tabs = [page, *(page.context.new_page() for _ in range(5))]
    for tab in tabs[1:]:
        tab.goto(rig.link)
        say(tab, "MOUNT")
    with frozen(rig.numbers["campaign"]):
        for tab in tabs:
            pause = tab.locator("form[action=pause] button")
            for _ in range(6):
                pause.evaluate("button => button.click()")
            expect(pause).to_be_disabled()
        page.bring_to_front()
        begin = time.monotonic()
        page.keyboard.press("Escape")
        say(page, "STOPPED")
        assert time.monotonic() - begin < 1.0


def test_rule_1_a_stop_survives_reload_and_a_server_that_starts_again(page, rig):
    expect(page.locator("#sent")).to_be_hidden()
    with frozen(rig.numbers["hammer"]):
        page.keyboard.press("Escape")
        expect(page.locator("#sent")).to_have_text("SENT")
        expect(page.locator("#sent")).to_have_text("NOT CONFIRMED: use the switch")
        page.reload()
        os.kill(rig.numbers["page"], signal.SIGKILL)
        say(page, "NO CONNECTION: KEEP AWAY")
        rig.start_page("--address", "0.0.0.0")
        say(page, "STOP IS NOT CONFIRMED")
    say(page, "STOPPED")
    expect(page.locator("#stopped")).to_contain_text("STOPPED")
    page.get_by_role("button", name="Reset the stop").click()
    # It is not sent again.
    say(page, "ARM FIRST")
    page.wait_for_timeout(1000.0)
    say(page, "ARM FIRST")


# 2. After a stop a person arms.


@pytest.mark.parametrize("button", ["Start", "Trial hit"])
def test_rule_2_after_a_stop_nothing_but_arm_arms(page, button):
    page.keyboard.press("Escape")
    say(page, "STOPPED")
    page.get_by_role("button", name="Reset the stop").click()
    say(page, "ARM FIRST")
    before = count_hits(page)
    start(page, "steel small", ask=False, button=button)
    expect(page.locator("form[action=end] button")).to_be_visible()
    say(page, "ARM FIRST")
    page.keyboard.press("p")
    page.wait_for_timeout(1500.0)
    assert count_hits(page) == before or count_hits(page) == 0
    expect(page.locator("#hammer")).not_to_contain_text("yes, since")
    say(page, "ARM FIRST")


# 3. An act belongs to what the person saw.


def test_rule_3_an_act_that_a_frozen_server_or_node_takes_late_is_not_done(page, rig):
    ask_for(page)
    for name in ("page", "campaign"):
        wait_to_read(page)
        with frozen(rig.numbers[name]):
            page.keyboard.press("Enter")
            page.wait_for_timeout(3000.0)
        expect(page.locator("#answer")).to_contain_text("not done: it came")
        say(page, "MOUNT steel small")
    assert count_hits(page) == 0


# 4. Hands in, hammer disarmed.


def test_rule_4_hands_are_in_a_disarmed_hammer_and_any_key_holds_it_back(page):
    ask_for(page)
    expect(page.locator("#hammer")).to_contain_text("no: while steel small is mounted")
    page.keyboard.press("Enter")
    expect(page.locator("#answer")).to_contain_text("Too soon")
    say(page, "MOUNT steel small")
    wait_to_read(page)
    page.keyboard.press("Enter")
    for seconds in (3, 2, 1):
        say(page, f"KEEP AWAY · {seconds} s")
    say(page, "DONE")
    ask_for(page)
    wait_to_read(page)
    page.keyboard.press("Enter")
    say(page, "KEEP AWAY · 3 s")
    page.keyboard.press("Enter")
    say(page, "PAUSED")
    assert count_hits(page) == 0


# 5. Nothing old is shown as true.


def test_rule_5_a_hammer_that_does_not_answer_goes_before_everything(page, rig):
    start(page, "steel small", ask=False)
    say(page, "DONE")
    with frozen(rig.numbers["hammer"]):
        say(page, "THE HAMMER DOES NOT ANSWER: keep away, use the switch")
        expect(page.locator("#hammer")).to_contain_text("not known")
    say(page, "DONE")


def test_rule_5_without_a_connection_the_page_itself_says_so_as_large(page, rig):
    size = "element => getComputedStyle(element).fontSize"
    large = page.locator("#say b").evaluate(size)
    with frozen(rig.numbers["page"]):
        say(page, "NO CONNECTION: KEEP AWAY")
        assert page.locator("#alarm b").evaluate(size) == large
        expect(page.locator("#say")).to_be_hidden()
    expect(page.locator("#say")).to_be_visible()


WATCH = """() => {
  window.said = [];
  const say = document.getElementById("say");
  new MutationObserver(() => window.said.push(say.querySelector("b").textContent))
    .observe(say, { subtree: true, childList: true, characterData: true });
}"""


def test_rule_5_a_browser_that_was_asleep_shows_the_newest_alone(page, rig):
    renderers = [
        process.pid
        for process in psutil.Process().children(recursive=True)
        if "--type=renderer" in process.cmdline()
    ]
    page.evaluate(WATCH)
    with RigClient("other") as client, frozen(*renderers):
        for _ in range(4):
            client.call(Act, interfaces.HAMMER_ACTS["stop"], Act.Request(by="Bob"), PATIENCE)
            client.spin_until(lambda: False, 0.5)
            client.call(Act, interfaces.RESET_HAMMER, Act.Request(by="Bob"), PATIENCE)
            client.spin_until(lambda: False, 0.5)
    say(page, "ARM FIRST")
    assert set(page.evaluate("window.said")) <= {"ARM FIRST"}


# 6. An empty choice is refused.


def test_rule_6_no_sample_chosen_strikes_none(page):
    start(page, ask=False)
    expect(page.locator("#answer")).to_contain_text("no sample is chosen")
    expect(page.locator("form[action=end]")).to_have_count(0)


# 7. Who did it.


def read_strings(rig, kind="std_msgs/msg/String"):
    """Return what the recording says in messages of a kind: of acts, if no other is named."""
    return [str(decode_message(raw)) for raw in Run(rig.folder).read_messages({kind})]


def test_rule_7_a_stop_from_elsewhere_says_from_where_and_acts_have_object_and_person(page, rig):
    with RigClient("other") as client:
        by = Act.Request(by="Bob at the command line of lab3")
        client.call(Act, interfaces.HAMMER_ACTS["stop"], by, PATIENCE)
        say(page, "STOPPED")
        expect(page.locator("#stopped")).to_contain_text("by Bob at the command line of lab3")
        page.get_by_role("button", name="Reset the stop").click()
        say(page, "ARM FIRST")
        expect(page.locator("#stopped")).not_to_contain_text("Bob")
        page.locator("#moment button").click()
        expect(page.locator("#hammer")).to_contain_text("yes, since")
        page.locator("input[name=who]").fill("Anna")
        page.get_by_role("button", name="Keep it").click()
        ask_for(page)
        wait_to_read(page)
        page.keyboard.press("Enter")
        wanted = "Anna at the page (127.0.0.1): mounted steel small"
        assert client.spin_until(lambda: wanted in str(read_strings(rig)), PATIENCE)


# 8. The token is a secret.


def test_rule_8_the_token_stands_nowhere_and_lives_through_a_restart(page, rig, browser):
    os.kill(rig.numbers["page"], signal.SIGKILL)
    say(page, "NO CONNECTION")
    rig.start_page("--address", "0.0.0.0")
    expect(page.locator("#say")).to_be_visible()
    guest = browser.new_context().new_page()
    assert guest.goto(rig.link).status == 200
    assert guest.goto(f"http://127.0.0.1:{rig.port}/").status == 200
    assert guest.goto(f"http://LOCALHOST:{rig.port}/?token={rig.token}").status == 200
    assert browser.new_context().new_page().goto(guest.url).status == 403
    told = "".join(read_strings(rig, "rcl_interfaces/msg/Log"))
    assert "the page listens at" in told
    texts = [told, *(path.read_text("utf-8") for path in rig.folder.glob("*.log"))]
    assert not any(rig.token in text for text in texts)
    kept = (rig.folder.parent / "state").rglob("page-*")
    assert [path.read_text() for path in kept] == [rig.token]


# 9. SIMULATED needs both: see also the by-hand rig of test_page.


def test_rule_9_computed_hits_and_a_holder_that_swings_nothing_are_simulated(page):
    expect(page.locator("#banner")).to_have_text("SIMULATED: no hammer strikes")


# 10. A stranger cannot take STOP away.


def test_rule_10_a_thousand_half_open_connections_take_no_stop_away(page, rig):
    log = rig.folder / "nodes.log"
    before = log.stat().st_size
    with contextlib.ExitStack() as opened:
        for _ in range(1000):
            stranger = opened.enter_context(socket.create_connection(("127.0.0.1", rig.port)))
            stranger.send(b"GET /")
        begin = time.monotonic()
        page.keyboard.press("Escape")
        say(page, "STOPPED")
        assert time.monotonic() - begin < 1.0
        page.reload()
        say(page, "STOPPED")
    assert log.stat().st_size - before < 10_000


# 11. Keys.


@pytest.mark.parametrize("key", ["Escape", "F12", "Pause"])
def test_rule_11_stop_keys_stop_in_text_fields_too(page, key):
    page.get_by_label("note on the run").focus()
    page.keyboard.press(key)
    say(page, "STOPPED")


def test_rule_11_space_stops_where_nothing_is_focused_and_nowhere_else(page):
    box = page.locator("#start input[name=sample]").first
    box.focus()
    page.keyboard.press(" ")
    expect(box).not_to_be_checked()
    page.get_by_label("note on the run").focus()
    page.keyboard.type("two words")
    page.locator("form[action=monitor] button").focus()
    page.keyboard.press(" ")
    expect(page.locator("#monitor tbody tr")).to_have_count(2)
    expect(page.locator("#say")).not_to_contain_text("STOP")
    page.locator("form[action=monitor] button").click()
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press(" ")
    say(page, "STOPPED")


# Beside the rules.


def test_the_last_hit_is_rejected_and_taken_back_by_a_key_each(page):
    page.locator("input[name=who]").fill("Anna")
    page.get_by_role("button", name="Keep it").click()
    start(page, "steel small", ask=False)
    say(page, "DONE")
    page.evaluate("document.activeElement.blur()")
    expect(page.locator("#end")).to_contain_text("results.json")
    page.keyboard.press("3")  # the list is closed
    page.keyboard.press("r")
    page.keyboard.press("3")
    expect(page.locator("#rows tr").first).to_contain_text(
        "left out by hand, by Anna: struck twice"
    )
    say(page, "ENDED")
    page.keyboard.press("u")
    say(page, "DONE")


def test_what_is_typed_focused_and_open_survives_an_update(page):
    start(page, "steel small", "brass small", ask=True)
    for sample in ("steel small", "brass small"):
        say(page, f"MOUNT {sample}")
        wait_to_read(page)
        page.keyboard.press("Enter")
        if sample == "steel small":
            say(page, "MOUNT brass small")
            page.locator("#rows summary").first.click()
            note = page.get_by_label("note on the hit").first
            note.fill("half a sent")
            page.locator("#moment button").focus()
            wait_to_read(page)
            page.evaluate("window.note = document.querySelector('#rows details')")
            note.focus()
            page.locator("#moment button").click()
            note.focus()
            break
    say(page, "DONE")
    expect(page.locator("#rows tr")).to_have_count(2)
    kept = page.locator("#rows tr").last
    assert kept.locator("details").evaluate("item => item.open && item === window.note")
    expect(kept.get_by_label("note on the hit")).to_have_value("half a sent")
    expect(kept.get_by_label("note on the hit")).to_be_focused()


def check_access(page):
    """Assert that axe-core finds nothing serious."""
    from axe_playwright_python.sync_playwright import Axe

    found = Axe().run(page).response["violations"]
    serious = [
        (it["id"], [node["html"] for node in it["nodes"]][:3])
        for it in found
        if it["impact"] in ("serious", "critical")
    ]
    assert not serious


@pytest.mark.parametrize("look", ["light", "dark"])
@pytest.mark.parametrize("size", [(1920, 1080), (390, 800)])
def test_everybody_can_use_the_page_in_each_state(page, rig, look, size):
    page.emulate_media(color_scheme=look)
    page.set_viewport_size({"width": size[0], "height": size[1]})
    is_inside = "document.documentElement.scrollWidth <= innerWidth"

    def look_at(sentence):
        say(page, sentence)
        check_access(page)
        assert page.evaluate(is_inside)
        expect(page.locator("#stop button")).to_be_in_viewport()

    look_at("")
    ask_for(page)
    look_at("MOUNT")
    expect(page.locator("#moment button")).to_be_in_viewport()
    wait_to_read(page)
    page.keyboard.press("Enter")
    say(page, "KEEP AWAY")
    look_at("DONE")
    with frozen(rig.numbers["page"]):
        look_at("NO CONNECTION")
    page.keyboard.press("Escape")
    look_at("STOPPED")
    page.get_by_role("button", name="Reset the stop").click()
    look_at("ARM FIRST")
