"""A set-up read back from a recording, today's and those written before uncertainties."""

import copy
import math
from types import SimpleNamespace

import pytest

from impact_rig.core.setup.samples import DEFAULT_CLOCK_UNCERTAINTY
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.recording.interfaces.messages import setup_from_msg

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
