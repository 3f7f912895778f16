"""The page's node: a stop waits for nothing that the node has to do beside it."""

import http.client
import json
import threading

from impact_rig.nodes.page import PageNode
from impact_rig.page.states import NO_HAMMER


def act(server, name):
    """Do what a form of the page does; return the answer."""
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
    headers = {
        "Origin": server.origin,
        "Accept": "application/json",
        "Content-Type": "application/x-www-form-urlencoded",
    }
    connection.request("POST", f"/{name}", "", headers)
    answer = json.loads(connection.getresponse().read())
    connection.close()
    return answer


def test_a_stop_is_confirmed_while_messages_keep_the_page_busy(harness, start_process):
    start_process("hammer").wait_for("active")
    page = harness.add(PageNode, port=0)
    harness.wait_until(lambda: page._status.hammer is not NO_HAMMER)
    free = threading.Event()
    busy = threading.Thread(target=harness.run, args=(lambda: free.wait(60.0),))
    busy.start()
    try:
        assert act(page._server, "stop")["done"]
        harness.wait_until(lambda: "STOPPED" in page._server.fragments["say"])
        # Reset is one act, arming another; where that is refused, it says why.
        refused = act(page._server, "arm")
        assert (refused["done"], bool(refused["message"])) == (False, True)
        assert act(page._server, "reset")["done"]
        assert act(page._server, "arm")["done"]
        assert busy.is_alive()
    finally:
        free.set()
        busy.join()
