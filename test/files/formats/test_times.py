"""Times in seconds, ms, µs and samples: one rate, or a refusal that says which unit is missing."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import pyuff
from scipy.io import savemat

from impact_rig.core.given.errors import SignalError
from impact_rig.files.channels import map_channels
from impact_rig.files.formats.registry import read_measurement
from impact_rig.files.plan import ChannelPlan

from .foreign import make_function

SECONDS = np.arange(2000) / 1e6
PULSE = np.exp(-4 * np.log(2) * ((SECONDS - 5e-4) / 1e-4) ** 2)
SCALES = {"s": 1.0, "ms": 1e3, "us": 1e6}


def write_text(path: Path, name: str, times: np.ndarray) -> None:
    np.savetxt(
        path, np.stack([times, PULSE]).T, header=f"{name},force", delimiter=",", comments=""
    )


def write_mat(path: Path, name: str, times: np.ndarray) -> None:
    savemat(path, {name: times, "force": PULSE})


def write_uff(path: Path, name: str, times: np.ndarray) -> None:
    unit = name.partition("_")[2] or "NONE"
    function = make_function(abscissa_spacing=1, data=PULSE, x=times, abscissa_axis_units_lab=unit)
    pyuff.UFF(str(path)).write_sets([function])


WRITERS: dict[str, Callable[[Path, str, np.ndarray], None]] = {
    "hit.csv": write_text,
    "hit.mat": write_mat,
    "hit.uff": write_uff,
}
formats = pytest.mark.parametrize("name", WRITERS)


def read_rate(path: Path, **given: object) -> float:
    (hit,) = map_channels(read_measurement(path), ChannelPlan(**given))  # type: ignore[arg-type]
    return hit.block.sampling_rate


@formats
@pytest.mark.parametrize(("unit", "scale"), SCALES.items())
def test_the_unit_of_times_is_stated_given_or_asked_for(tmp_path, name, unit, scale):
    path = tmp_path / name
    WRITERS[name](path, f"time_{unit}", scale * SECONDS)
    assert read_rate(path) == pytest.approx(1e6, rel=1e-8)
    path.unlink()
    WRITERS[name](path, "time", scale * SECONDS)
    if unit == "s":
        assert read_rate(path) == pytest.approx(1e6, rel=1e-8)
    else:
        with pytest.raises(SignalError, match=rf'in {unit} 99 us .*time_unit = "\?"'):
            read_rate(path)
    assert read_rate(path, time_unit=unit) == pytest.approx(1e6, rel=1e-8)
    assert read_rate(path, sampling_rate=1e6) == 1e6


def test_a_step_without_a_unit_is_asked_for_it_too(tmp_path):
    path = tmp_path / "hit.mat"
    savemat(path, {"dt": 1e-3, "force": PULSE})
    with pytest.raises(SignalError, match="in ms 99 us"):
        read_rate(path)
    assert read_rate(path, time_unit="ms") == 1e6
