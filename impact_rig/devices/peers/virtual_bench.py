"""A bench with a hammer that really swings, as far as instruments can see: one hit a strike."""

from collections import Counter

from impact_rig.core.errors import ParameterError
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.rig import VirtualHit, VirtualRig, VirtualRigSettings


class VirtualBench:
    """What a stand-in for an instrument measures: the next hit of the sample that is mounted.

    Nobody tells it of records and attempts: each strike of a sample is the next of its series, as
    on a real bench.

    Parameters
    ----------
    setup : RigSetup
        Masses and samples.
    settings : VirtualRigSettings
        Physics, scatter, seed and faults of the hits.
    """

    def __init__(self, setup: RigSetup, settings: VirtualRigSettings) -> None:
        self._rig = VirtualRig(setup, settings)
        self._strikes: Counter[str] = Counter()
        self.sample = ""
        """The one that is mounted; empty: none."""

    def mount(self, sample: str) -> None:
        """Put a sample in the hammer's way.

        Raises
        ------
        ParameterError
            If it is unknown, or lacks a reference value.
        """
        self._rig.check_sample(sample)
        self.sample = sample

    def strike(self) -> VirtualHit:
        """Let the hammer strike once.

        Raises
        ------
        ParameterError
            If no sample is mounted.
        """
        if not self.sample:
            raise ParameterError("no sample is mounted: the hammer strikes nothing")
        self._strikes[self.sample] += 1
        impact = self._strikes[self.sample]
        return self._rig.strike(HitLabel(self.sample, record=impact, impact=impact))
