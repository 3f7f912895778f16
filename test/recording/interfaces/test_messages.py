"""A set-up read back from a recording, today's and those written before uncertainties."""

import copy
import math
from array import array
from types import SimpleNamespace

import numpy as np
import pytest

from impact_rig.core.setup.samples import DEFAULT_CLOCK_UNCERTAINTY
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.record import NOT_ARMED, HitLabel
from impact_rig.recording.interfaces.messages import setup_from_msg, stream_block_from_msg

MESSAGE = SimpleNamespace(
    name="bench",
    description="",
    hammer_mass=0.1,
    hammer_mass_uncertainty=2e-4,
    accelerometer_mass=3e-3,
    accelerometer_mass_uncertainty=1e-4,
    clock_uncertainty=1e-6,
    impact_speed=0.08,
    control_sample="oak",
    samples=[
        SimpleNamespace(
            name="oak",
            material="wood",
            mass=0.1,
            mass_uncertainty=5e-6,
            reference_contact_time=math.nan,
            reference_stiffness=math.nan,
            reference_damping_coefficient=math.nan,
        )
    ],
    analysis=SimpleNamespace(
        **{name: getattr(AnalysisSettings(), name) for name in vars(AnalysisSettings())}
    ),
)


def test_stated_uncertainties_are_read():
    setup = setup_from_msg(MESSAGE)
    assert setup.hammer_mass_uncertainty == 2e-4
    assert setup.samples.accelerometer_mass_uncertainty == 1e-4
    assert setup.clock_uncertainty == 1e-6
    assert setup.samples.find("oak").mass_uncertainty == 5e-6


def test_a_recording_older_than_the_uncertainties_states_none():
    old = copy.deepcopy(MESSAGE)
    del old.hammer_mass_uncertainty, old.accelerometer_mass_uncertainty, old.clock_uncertainty
    del old.samples[0].mass_uncertainty
    setup = setup_from_msg(old)
    assert setup.hammer_mass_uncertainty == 0.0
    assert setup.samples.accelerometer_mass_uncertainty == 0.0
    assert setup.samples.find("oak").mass_uncertainty == 0.0
    assert setup.clock_uncertainty == pytest.approx(DEFAULT_CLOCK_UNCERTAINTY)


def test_a_recording_older_than_the_selection_keeps_all_hits_however_strong():
    old = copy.deepcopy(MESSAGE)
    del old.analysis.maximum_peak, old.analysis.keep_hits
    analysis = setup_from_msg(old).analysis
    assert (analysis.maximum_peak, analysis.keep_hits) == (1.0, 0)


def test_the_selection_of_a_recording_is_read():
    new = copy.deepcopy(MESSAGE)
    new.analysis.maximum_peak, new.analysis.keep_hits = 0.9, 10
    analysis = setup_from_msg(new).analysis
    assert (analysis.maximum_peak, analysis.keep_hits) == (0.9, 10)


class TestStreamBlock:
    """A block of the running stream."""

    def make(self, counts: object, values: object = (), **fields: object) -> SimpleNamespace:
        channel = SimpleNamespace(
            counts=counts, values=values, scale=0.5, offset=0.0, full_scale=2000.0
        )
        place = {"record": 0, "sample": "", "impact": 0, "attempt": 0, "last": False, **fields}
        return SimpleNamespace(
            header=SimpleNamespace(stamp=SimpleNamespace(sec=2, nanosec=7)),
            first_sample=5000,
            sampling_rate=2.5e6,
            hammer=channel,
            specimen=channel,
            **place,
        )

    def test_reads_the_message_s_own_counts(self) -> None:
        counts = array("i", range(100))
        block = stream_block_from_msg(self.make(counts))
        assert np.shares_memory(block.hammer.output, np.frombuffer(counts, np.int32))
        assert not block.hammer.output.flags.writeable
        assert (block.first_sample, block.stamp, block.label) == (5000, 2_000_000_007, NOT_ARMED)

    def test_reads_numbers_of_a_source_that_does_not_count_in_place(self) -> None:
        values = array("d", [0.25, 0.5])
        block = stream_block_from_msg(self.make(array("i"), values))
        assert np.shares_memory(block.hammer.output, np.frombuffer(values))
        assert block.hammer.resolution == 0.0

    def test_belongs_to_the_arming_under_way(self) -> None:
        message = self.make(
            array("i", [1]), record=3, sample="oak", impact=2, attempt=1, last=True
        )
        block = stream_block_from_msg(message)
        assert (block.label, block.last) == (HitLabel("oak", 3, 2, 1), True)
