"""Who may move the hammer, and what the screen may say: real keys, a real browser, frozen nodes.

The numbers are those of the table in the page's README.
"""

import contextlib
import re
import resource
import socket
import time

import psutil
import pytest

from impact_rig.configuration.rig_file import read_template
from impact_rig.recordings.run import Run
from impact_rig.recordings.schemas import decode_message

from .conftest import PATIENCE
from .page_rig import (
    ARM_FIRST,
    MILLISECONDS,
    expect,
    frozen,
    give_name,
    press,
    run_rig,
    say,
    start,
)


@pytest.fixture(scope="module")
def rig(browser, tmp_path_factory):
    """Return a rig whose hammer goes by itself, three seconds after its notice."""
    with run_rig(
        tmp_path_factory.mktemp("rig"), read_template(),
        "hammer.lead_time=3.0", "hammer.swing_time=0.2", "page.address=0.0.0.0",
    ) as running:  # fmt: skip
        yield running


def count_hits(page):
    return page.locator("#rows tr").count()


def wait_to_read(page):
    """Wait until the sentence stands long enough to be read."""
    page.wait_for_function("() => performance.now() - newSince > READING")


def ask_for(page, sample="steel small"):
    """Start a campaign, until its sample is asked for."""
    start(page, sample, ask=True)
    say(page, f"MOUNT {sample}")


def stop_and_reset(page):
    page.keyboard.press("Escape")
    say(page, "STOPPED")
    press(page, "Reset the stop")
    say(page, ARM_FIRST)


def test_rule_1_six_acts_under_way_delay_no_stop(page, rig):
    ask_for(page)
    # A browser has six connections to a server, for all of its tabs.
    tabs = [page, *(page.context.new_page() for _ in range(5))]
    for tab in tabs[1:]:
        tab.goto(rig.link)
        say(tab, "MOUNT")
    with rig.frozen("campaign"):
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
    with rig.frozen("hammer"):
        page.keyboard.press("Escape")
        expect(page.locator("#sent")).to_have_text("SENT")
        expect(page.locator("#sent")).to_have_text("NOT CONFIRMED: use the switch")
        page.reload()
        rig.restart_page(page)
        say(page, "STOP IS NOT CONFIRMED")
    say(page, "STOPPED")
    expect(page.locator("#stopped")).to_contain_text("STOPPED")
    press(page, "Reset the stop")
    # It is not sent again.
    say(page, ARM_FIRST)
    page.wait_for_timeout(700.0)
    say(page, ARM_FIRST)


def test_rule_2_after_a_stop_nothing_but_arm_arms(page):
    stop_and_reset(page)
    for button in ("Trial hit", "Start"):
        start(page, "steel small", button=button)
        end = page.locator("form[action=end] button")
        expect(end).to_be_visible()
        say(page, "ARM FIRST")
        page.wait_for_timeout(1000.0)
        assert count_hits(page) == 0
        if button == "Trial hit":
            end.click()
            expect(page.locator("#start form")).to_be_visible()
    page.keyboard.press("p")
    # The page offers no "Go on" now; one that is there all the same arms nothing.
    answer = page.locator("#answer")
    for _ in range(20):
        page.evaluate(
            """() => document.querySelector("main").insertAdjacentHTML(
              "afterbegin", "<form method=post action=resume><button>Go on</button></form>")"""
        )
        page.get_by_role("button", name="Go on").first.click()
        expect(answer).to_contain_text(re.compile("not done|first"))
        if "rm the hammer first" in answer.inner_text():
            break  # else the campaign's state has just changed
    expect(answer).to_contain_text("rm the hammer first")
    page.wait_for_timeout(1000.0)
    assert count_hits(page) == 0
    expect(page.locator("#hammer")).not_to_contain_text("yes, since")
    say(page, "ARM FIRST")


def test_rule_3_an_act_that_a_frozen_server_or_node_takes_late_is_not_done(page, rig):
    ask_for(page)
    for name in ("page", "campaign"):
        wait_to_read(page)
        with rig.frozen(name):
            page.keyboard.press("Enter")
            page.wait_for_timeout(2300.0)
        # The sentence may also have become another one meanwhile.
        expect(page.locator("#answer")).to_contain_text("not done: ", timeout=MILLISECONDS)
        say(page, "MOUNT steel small")
    assert count_hits(page) == 0


def test_rule_4_hands_are_in_a_disarmed_hammer_and_any_key_holds_it_back(page, rig):
    assert rig.do("arm")
    ask_for(page)
    expect(page.locator("#hammer")).to_contain_text("no: while steel small is mounted")
    page.keyboard.press("Enter")
    expect(page.locator("#answer")).to_contain_text("Too soon")
    say(page, "MOUNT steel small")
    wait_to_read(page)
    page.keyboard.press("Enter")
    say(page, "KEEP AWAY · 3 s")
    page.keyboard.press("Enter")
    say(page, "PAUSED")
    assert count_hits(page) == 0
    press(page, "Go on")
    for seconds in (3, 2, 1):
        say(page, f"KEEP AWAY · {seconds} s")
    say(page, "DONE")


def test_rule_5_a_hammer_that_does_not_answer_goes_before_everything(page, rig):
    ask_for(page)
    with rig.frozen("hammer"):
        say(page, "THE HAMMER DOES NOT ANSWER: keep away, use the switch")
        expect(page.locator("#hammer")).to_contain_text("not known")
    expect(page.locator("#say")).not_to_contain_text("DOES NOT ANSWER")


def test_rule_5_without_a_connection_the_page_itself_says_so_as_large(page, rig):
    size = "element => getComputedStyle(element).fontSize"
    ask_for(page)
    large = page.locator("#say b").evaluate(size)
    with rig.frozen("page"):
        say(page, "NO CONNECTION: KEEP AWAY")
        assert page.locator("#alarm b").evaluate(size) == large
        for old in ("#say", "#moment button"):
            expect(page.locator(old)).to_be_hidden()
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
    with frozen(*renderers):
        for act in 4 * ("stop", "reset"):
            rig.do(act, "Bob")
            time.sleep(0.4)
    say(page, ARM_FIRST)
    assert all(ARM_FIRST.search(said) for said in page.evaluate("window.said"))


def test_rule_6_no_sample_chosen_strikes_none(page):
    start(page)
    expect(page.locator("#answer")).to_contain_text("no sample is chosen")
    expect(page.locator("form[action=end]")).to_have_count(0)


def read_strings(rig, kind="std_msgs/msg/String"):
    """Return what the recording says in messages of a kind: of acts, if no other is named."""
    return str([decode_message(raw) for raw in Run(rig.folder).read_messages({kind})])


def test_rule_7_a_stop_from_elsewhere_says_from_where_and_acts_have_object_and_person(page, rig):
    rig.do("stop", "Bob at the command line of lab3")
    say(page, "STOPPED")
    expect(page.locator("#stopped")).to_contain_text("by Bob at the command line of lab3")
    press(page, "Reset the stop")
    say(page, ARM_FIRST)
    expect(page.locator("#stopped")).not_to_contain_text("Bob")
    page.locator("#moment button").click()
    expect(page.locator("#hammer")).to_contain_text("yes, since")
    give_name(page, "Anna <b>")
    note = page.get_by_label("note on the run")
    note.fill("the wax is new")
    note.press("Enter")
    expect(note).to_have_value("")
    ask_for(page)
    wait_to_read(page)
    page.keyboard.press("Enter")
    for told in ("mounted steel small", "the wax is new"):
        wanted = f"Anna <b> at the page (127.0.0.1): {told}"
        expect(page.locator("#notes")).to_contain_text(wanted)
        assert rig.client.spin_until(lambda it=wanted: it in read_strings(rig), PATIENCE)


def test_rule_8_the_token_stands_nowhere_and_lives_through_a_restart(page, rig, browser):
    rig.restart_page(page)
    expect(page.locator("#say")).to_be_visible()
    guest = browser.new_context().new_page()
    assert guest.goto(rig.link).status == 200
    assert guest.goto(f"http://127.0.0.1:{rig.port}/").status == 200
    assert guest.goto(f"http://LOCALHOST:{rig.port}/?token={rig.token}").status == 200
    assert browser.new_context().new_page().goto(guest.url).status == 403
    told = read_strings(rig, "rcl_interfaces/msg/Log")
    assert "the page listens at" in told
    texts = [told, *(path.read_text("utf-8") for path in rig.folder.glob("*.log"))]
    assert not any(rig.token in text for text in texts)
    assert [path.read_text() for path in rig.state.rglob("page-*")] == [rig.token]


# Of rule 9 see also the by-hand rig of test_page.
def test_rule_9_computed_hits_and_a_holder_that_swings_nothing_are_simulated(page):
    expect(page.locator("#banner")).to_have_text("SIMULATED: no hammer strikes")


def test_rule_10_a_thousand_half_open_connections_take_no_stop_away(page, rig):
    # As many files as a process may open on most computers, and no more.
    resource.prlimit(rig.numbers["page"], resource.RLIMIT_NOFILE, (1024, 1024))
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


def test_rule_11_stop_keys_stop_in_text_fields_too(page, rig):
    for key in ("Escape", "F12", "Pause"):
        page.get_by_label("note on the run").focus()
        page.keyboard.press(key)
        say(page, "STOPPED")
        rig.do("reset")
        say(page, ARM_FIRST)


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
