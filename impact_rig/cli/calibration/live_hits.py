"""Hits that an operator strikes now, from the source of a rig file."""

from collections.abc import Generator, Iterator

from impact_rig.cli.drivers.rig_check import plan_source
from impact_rig.configuration.rig_file import RigFile
from impact_rig.core.hits.hit import JudgedHit, judge_hit
from impact_rig.core.signals.detection import ImpactDetector
from impact_rig.core.signals.record import Block, HitLabel
from impact_rig.devices.acceleration_source import AccelerationSource, SimulatedSource

LOOK_PERIOD = 0.5
"""How often an interruption is looked for while nobody strikes [s], our choice."""


def strike_hits(rig: RigFile) -> Generator[JudgedHit]:
    """Yield hit after hit; the source is closed when nobody asks for more.

    Parameters
    ----------
    rig : RigFile
        Its source is opened, its holder is not.

    Raises
    ------
    RigError
        If the source cannot be opened, or is lost.
    """
    source, plan = plan_source(rig)
    detector = ImpactDetector(rig.setup.analysis)
    name, record = rig.setup.samples.names[0], 0
    try:
        rate = source.configure(plan).sampling_rate
        if isinstance(source, SimulatedSource):
            source.take_setup(rig.setup)
        while True:
            record += 1
            label = HitLabel(name, record, record)
            source.arm()
            if isinstance(source, SimulatedSource):
                source.strike(label, 0.0)
            for block in _read_record(source, label, rate):
                for found in detector.feed(block):
                    yield judge_hit(found, rig.setup.analysis)
    finally:
        source.close()


def _read_record(source: AccelerationSource, label: HitLabel, rate: float) -> Iterator[Block]:
    """Yield the blocks of one record, however long nobody strikes."""
    while True:
        block = source.read(LOOK_PERIOD)
        if block is None:
            continue
        yield Block(
            label=label,
            first_sample=block.first_sample,
            sampling_rate=rate,
            hammer=block.hammer,
            specimen=block.specimen,
            last=block.last,
            stamp=block.stamp,
        )
        if block.last:
            return
