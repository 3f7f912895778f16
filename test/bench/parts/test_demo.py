"""The part `demo`."""

from impact_rig.bench.part import Bench
from impact_rig.bench.parts import demo


def test_every_campaign_is_timed(bench: Bench) -> None:
    (figure,) = demo.measure(bench)
    assert figure.values == (1.5,) * bench.extent.demos
    assert (figure.unit, str(figure.goal)) == ("s", "at most 20")
