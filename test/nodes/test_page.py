"""The page's node: a stop waits for nothing beside it, and strangers change nothing."""

import http.client
import json
import signal
import threading
import urllib.parse

import pytest
from builtin_interfaces.msg import Time
from impact_rig_msgs.msg import CampaignState
from impact_rig_msgs.srv import JoinCampaign

from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.nodes import interfaces
from impact_rig.nodes.campaign import CampaignNode
from impact_rig.nodes.identity import id_to_msg, make_id
from impact_rig.nodes.messages import setup_to_msg
from impact_rig.nodes.page import PageNode
from impact_rig.status.states import NO_HAMMER


def act(server, name, **fields):
    """Do what a form of the page does; return the answer."""
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
    headers = {
        "Origin": server.origin,
        "Accept": "application/json",
        "Content-Type": "application/x-www-form-urlencoded",
    }
    fields = {"seen": server.seen} | fields
    connection.request("POST", f"/{name}", urllib.parse.urlencode(fields), headers)
    answer = json.loads(connection.getresponse().read())
    connection.close()
    return answer


@pytest.fixture
def hammer(start_process):
    started = start_process("hammer")
    started.wait_for("active")
    return started


@pytest.fixture
def page(harness, hammer):
    shown = harness.add(PageNode, port=0)
    harness.wait_until(lambda: shown._status.hammer is not NO_HAMMER)
    return shown


def test_a_stop_is_confirmed_while_messages_keep_the_page_busy(harness, page):
    free = threading.Event()
    busy = threading.Thread(target=harness.run, args=(lambda: free.wait(60.0),))
    busy.start()
    try:
        assert act(page._server, "stop")["done"]
        harness.wait_until(lambda: ">STOPPED" in page._server.fragments["say"])
        # Reset is one act, arming another; where that is refused, it says why.
        refused = act(page._server, "arm")
        assert (refused["done"], bool(refused["message"])) == (False, True)
        assert act(page._server, "reset")["done"]
        assert act(page._server, "arm")["done"]
        assert busy.is_alive()
    finally:
        free.set()
        busy.join()


def test_an_answer_that_comes_too_late_ends_nothing(harness, hammer, page):
    page._server.patience = 0.2
    hammer.process.send_signal(signal.SIGSTOP)
    try:
        assert "does not answer" in act(page._server, "stop")["message"]
    finally:
        hammer.process.send_signal(signal.SIGCONT)
    harness.wait_until(lambda: ">STOPPED" in page._server.fragments["say"])
    page._server.patience = 60.0
    assert act(page._server, "reset")["done"]


def test_a_stop_that_no_tab_repeats_is_asked_again_of_a_hammer_that_comes_back(
    harness, hammer, page, start_process
):
    hammer.process.kill()
    page._server.patience = 0.2
    assert not act(page._server, "stop")["done"]
    harness.wait_until(lambda: ">STOP IS NOT CONFIRMED" in page._server.fragments["say"])
    start_process("hammer").wait_for("active")
    harness.wait_until(lambda: ">STOPPED" in page._server.fragments["say"])


def test_a_campaign_that_is_refused_says_why_at_the_page(harness):
    page = harness.add(PageNode, port=0)
    harness.add(CampaignNode)
    harness.wait_until(lambda: not page._server.seen.endswith(" 0"))
    answers = []

    def start():
        answers.append(act(page._server, "start", sample="steel small", impacts=3, angles="95"))

    person = threading.Thread(target=start)
    person.start()
    harness.wait_until(lambda: answers)
    person.join()
    assert not answers[0]["done"]
    assert "release angle is 95°" in answers[0]["message"]


def test_what_another_campaign_says_is_not_shown(harness):
    page = harness.add(PageNode, port=0)
    ours, theirs = id_to_msg(make_id()), id_to_msg(make_id())
    setup = setup_to_msg(PAPER_SETUP, Time(sec=1))
    setup.campaign_id = ours
    assert harness.call(JoinCampaign, "page/join", JoinCampaign.Request(setup=setup)).success
    states = harness.advertise(interfaces.CAMPAIGN_STATE)
    states.publish(CampaignState(campaign_id=ours, sample="steel small", impacts=3))
    harness.wait_until(lambda: page._status.campaign.sample == "steel small")
    states.publish(CampaignState(campaign_id=theirs, sample="brass small", impacts=9))
    assert states.wait_for_all_acked()
    harness.wait_until(lambda: page.intake.ignored)
    assert page._status.campaign.sample == "steel small"
