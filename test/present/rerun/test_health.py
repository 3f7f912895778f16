"""How the rig is doing: the newest state in words, figures and states over the time of day."""

from impact_rig.status.states import Level, NodeHealth

STAMP = 1_700_000_000_000_000_000


def make_health(second, level, gaps):
    node = NodeHealth("estimator", level, "active", (("gaps", str(gaps)), ("size", "31250000000")))
    return (node,), STAMP + second


def test_states_and_figures_have_a_history_over_the_time_of_day(record):
    levels = (Level.OK, Level.OK, Level.ERROR, Level(77), Level.OK)
    states = zip(range(5), levels, (0, 2, 2, 3, 3), strict=True)

    view = record(*(lambda log, item=item: log.log_health(*make_health(*item)) for item in states))

    rows = view.read_rows("/health/history/losses/estimator/gaps")
    assert [row["wall_clock"] - STAMP for row in rows] == [0, 1, 2, 3, 4]
    assert [row["Scalars:scalars"] for row in rows] == [[0.0], [2.0], [2.0], [3.0], [3.0]]
    # A state is logged when it changes; what is no level counts as an error.
    rows = view.read_rows("/health/history/levels/estimator")
    changes = [(row["wall_clock"] - STAMP, row["StateChange:state"]) for row in rows]
    assert changes == [(0, ["ok"]), (2, ["error"]), (4, ["ok"])]


def test_the_newest_state_is_in_words(record):
    view = record(lambda log: log.log_health(*make_health(0, Level.WARNING, 5)))

    (text,) = view.find_static("/health/now", "TextDocument:text")
    assert text == "## ⚠ estimator: warning\n\nactive\n\ngaps **5** · size **31.250 GB**"
