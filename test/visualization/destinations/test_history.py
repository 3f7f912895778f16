"""What is kept for a viewer that comes late."""

from impact_rig.visualization.destinations.destination import QUEUE_LENGTH, QUEUE_SIZE
from impact_rig.visualization.destinations.history import History


def list_names(history):
    return [work for work, _ in history.list_works()]


def test_the_set_up_comes_first_then_the_hits_then_the_newest_of_each_table():
    history = History()
    history.put_latest("table", "old table")
    history.begin("set-up")
    history.put_latest("table", "table")
    history.put("hit 1", 0)
    history.put_latest("table", "new table")
    history.put("hit 2", 0)

    assert list_names(history) == ["set-up", "hit 1", "hit 2", "new table"]


def test_the_oldest_hits_are_forgotten_first_and_counted():
    history = History()
    history.begin("set-up")
    for i in range(QUEUE_LENGTH + 3):
        history.put(i, 0)
    assert history.forgotten == 3
    assert list_names(history) == ["set-up", *range(3, QUEUE_LENGTH + 3)]
    history.begin("the next")
    assert (history.forgotten, list_names(history)) == (0, ["the next"])


def test_large_hits_are_kept_up_to_a_size():
    history = History()
    for i in range(5):
        history.put(i, QUEUE_SIZE // 2)
    assert list_names(history) == [3, 4]
