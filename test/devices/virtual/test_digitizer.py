"""The acquisition chain: coupling, offset, noise, steps and rails."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.errors import ParameterError
from impact_rig.devices.virtual.digitizer import (
    DigitizerSettings,
    couple,
    digitize,
    find_scale,
)

CLEAN = DigitizerSettings(noise=0.0, offset=0.0, coupling_frequency=0.0)


def make_random() -> np.random.Generator:
    return np.random.default_rng(1)


def test_the_paper_is_the_default() -> None:
    settings = DigitizerSettings()
    assert (settings.sampling_rate, settings.bits, settings.count) == (2.5e6, 12, 5000)


@given(bits=st.integers(4, 24), full_scale=st.floats(1, 1e5), seed=st.integers(0, 99))
def test_quantisation_is_off_by_half_a_step_at_most(
    bits: int, full_scale: float, seed: int
) -> None:
    settings = DigitizerSettings(bits=bits, noise=0.0, offset=0.0, coupling_frequency=0.0)
    step = find_scale(full_scale, bits)
    largest = full_scale - step
    signal = np.random.default_rng(seed).uniform(-full_scale, largest, 500)
    counts = digitize(signal, full_scale, settings, make_random())
    assert counts.dtype == np.int32
    assert np.abs(counts * step - signal).max() <= step / 2 * (1 + 1e-9)


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_what_does_not_fit_stands_at_the_rails(bits: int) -> None:
    settings = DigitizerSettings(bits=bits, noise=0.0, offset=0.0, coupling_frequency=0.0)
    counts = digitize(np.array([-1e9, -101.0, 101.0, 1e9]), 100.0, settings, make_random())
    low, high = -(2 ** (bits - 1)), 2 ** (bits - 1) - 1
    np.testing.assert_array_equal(counts, [low, low, high, high])


def test_noise_offset_and_drift_are_parts_of_full_scale() -> None:
    settings = DigitizerSettings(
        bits=24, noise=1e-3, offset=2e-3, drift=0.1, coupling_frequency=0.0
    )
    counts = digitize(np.zeros(20_000), 2000.0, settings, make_random())
    signal = counts * find_scale(2000.0, 24)
    slope, start = np.polyfit(np.arange(20_000) / 20_000, signal, 1)
    # 20 000 points of noise 2: means within 0.03, slopes within 0.1.
    assert start == pytest.approx(4.0, abs=0.15)
    assert slope == pytest.approx(200.0, abs=0.4)
    noise = signal - start - slope * np.arange(20_000) / 20_000
    assert noise.std() == pytest.approx(2.0, rel=0.03)


def test_the_same_source_gives_the_same_noise() -> None:
    one, other = (
        digitize(np.zeros(1000), 2000.0, DigitizerSettings(), make_random()) for _ in range(2)
    )
    np.testing.assert_array_equal(one, other)


def test_coupling_answers_a_step_as_an_rc_stage_does() -> None:
    time = np.arange(5000) / 2.5e6
    answer = couple(np.ones(5000), 500.0, 2.5e6)
    # The bilinear design is half a point early: 0.06 % at this corner.
    np.testing.assert_allclose(answer, np.exp(-2 * np.pi * 500.0 * time), rtol=0, atol=1e-3)


@pytest.mark.parametrize("frequency", [100.0, 500.0, 5000.0])
def test_coupling_passes_half_the_power_at_its_corner(frequency: float) -> None:
    time = np.arange(200_000) / 2.5e6
    wave = np.sin(2 * np.pi * 500.0 * time)
    answer = couple(wave, frequency, 2.5e6)[100_000:]
    gain = np.sqrt(2.0) * answer.std()
    assert gain == pytest.approx(1 / np.hypot(1, frequency / 500.0), rel=5e-3)


def test_dc_coupling_passes_everything() -> None:
    signal = make_random().standard_normal(100)
    np.testing.assert_array_equal(couple(signal, 0.0, 2.5e6), signal)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sampling_rate": 0.0}, "sampling rate is 0.0 Hz"),
        ({"record_duration": -1.0}, "record duration is -1.0 s"),
        ({"record_duration": 1e-6}, "which is 2 points at 2.5e+06 Hz: a record needs 100"),
        ({"pre_trigger": 1.0}, "pre-trigger is 1.0: it must lie between 0 and 0.002"),
        ({"bits": 2}, "bits is 2: it must lie between 4 and 31"),
        ({"hammer_full_scale": 0.0}, "hammer full scale is 0.0 m/s^2"),
        ({"specimen_full_scale": -1.0}, "sample full scale is -1.0 m/s^2"),
        ({"noise": 2.0}, "noise is 2.0"),
        ({"offset": -0.1}, "offset is -0.1"),
        ({"drift": float("nan")}, "drift is nan"),
        ({"coupling_frequency": -1.0}, "coupling frequency is -1.0 Hz"),
        ({"trigger_jitter": -1.0}, "trigger jitter is -1.0 s"),
    ],
)
def test_what_cannot_be_meant_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError) as error:
        DigitizerSettings(**changes)
    assert message in str(error.value)
