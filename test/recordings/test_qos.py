"""Quality of service is written as rosbag2 of ROS 2 Jazzy does."""

import yaml

from impact_rig.recordings.qos import OfferedQos, format_offered_qos


def test_offers_are_written_one_after_the_other():
    latched = OfferedQos("reliable", "transient_local", "keep_last", 16)
    unknown = OfferedQos("best_effort", "volatile", "unknown", 0, lifespan=10_000_000_250)
    first, second = yaml.safe_load(format_offered_qos((latched, unknown)))
    assert (first["reliability"], first["durability"]) == ("reliable", "transient_local")
    assert (first["history"], first["depth"]) == ("keep_last", 16)
    assert (second["history"], second["depth"]) == ("unknown", 0)
    assert second["lifespan"] == {"sec": 10, "nsec": 250}


def test_without_a_publisher_nothing_is_offered():
    assert format_offered_qos(()) == ""
