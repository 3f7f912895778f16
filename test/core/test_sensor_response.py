"""A sensor's response: against its closed forms, and its high-pass undone."""

import numpy as np
import pytest

from impact_rig.core.errors import ParameterError
from impact_rig.core.filtering import respond, restore_level
from impact_rig.core.sensors import Sensor, SensorResponse

RATE = 1e6
TIME = np.arange(4000) / RATE
RAMP = np.clip(TIME * 1e4, 0.0, 1.0)


def test_a_resonance_answers_to_a_ramp_as_a_mass_on_a_spring():
    natural, damping = 2.0 * np.pi * 20e3, 0.1
    shown = respond(1e4 * TIME, SensorResponse(20e3, damping), RATE)
    damped = natural * np.sqrt(1.0 - damping**2)
    # Of x'' + 2 z w x' + w^2 x = w^2 b t from rest.
    turn = np.exp(-damping * natural * TIME) * (
        2.0 * damping / natural * np.cos(damped * TIME)
        - (1.0 - 2.0 * damping**2) / damped * np.sin(damped * TIME)
    )
    np.testing.assert_allclose(shown, 1e4 * (TIME - 2.0 * damping / natural + turn), atol=1e-9)


def test_a_low_corner_lets_a_level_decay_and_can_be_undone():
    corner = 300.0
    shown = respond(np.stack([RAMP, 2.0 * RAMP]), SensorResponse(0.0, 0.02, corner), RATE)
    level = np.exp(-2.0 * np.pi * corner * (TIME[-1] - TIME[2000]))
    assert shown[0, -1] == pytest.approx(shown[0, 2000] * level, rel=1e-9)
    np.testing.assert_allclose(
        restore_level(shown, corner, RATE), np.stack([RAMP, 2.0 * RAMP]), atol=1e-6
    )


@pytest.mark.parametrize(
    ("stated", "told"),
    [
        ({"resonance": -1.0}, "resonance of the hammer sensor is -1"),
        ({"resonance_damping": 0.0}, "resonance damping of the hammer sensor is 0.0"),
        ({"resonance": 10.0, "low_corner": 20.0}, "low corner of the hammer sensor is 20 Hz"),
        ({"sensitivity_uncertainty": -0.1}, "uncertainty of the sensitivity of the hammer"),
    ],
)
def test_what_no_sensor_does_is_refused(stated, told):
    with pytest.raises(ParameterError, match=told):
        Sensor("hammer", **stated)
