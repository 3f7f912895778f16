"""Files of any format, order, names, units, rates and gaps: a right number, or something is said.

The file is written here or by the library of its format, never by what reads it.
"""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from nptdms import ChannelObject, TdmsWriter
from pyarrow import parquet
from pyuff import UFF
from scipy.io import savemat

from impact_rig.analysis.analyze import judge
from impact_rig.analysis.measured_files import MeasuredFiles, make_series
from impact_rig.core.given.errors import RigError
from impact_rig.files.import_file import MeasurementOptions

from .formats.foreign import make_function

POINTS = 2000
TELLING = ["hammer", "Hammer 1", "impact_hammer", "force", "Tip", "Excitation"]
RESPONSES = ["response", "sample", "specimen"]
OPEN = ["ch1", "ch2", "ch3", "signal", "x"]
ACCELERATIONS = ["acc1", "acc2", "acceleration_z", "accel"]


@dataclasses.dataclass
class Written:
    """What a file holds, and what may be found in it."""

    name: str
    channels: list[tuple[str, str, np.ndarray]]  # name, unit, numbers
    rate: float
    duration: float  # of the hammer's pulse [s]
    is_told: bool  # names or units say which channel is the hammer's
    unit: str  # of the times as written; empty: as none
    lost: int  # points that are missing within the pulse


def make_pulse(rate: float, duration: float, seed: int) -> np.ndarray:
    """Return a half-sine with noise of a thousandth."""
    time = np.arange(POINTS) / rate - 0.3 * POINTS / rate
    inside = (time >= 0) & (time <= duration)
    noise = np.random.default_rng(seed).normal(0.0, 1e-3, POINTS)
    return np.where(inside, np.sin(np.pi * time / duration), 0.0) + noise


@st.composite
def files(draw: st.DrawFn) -> Written:
    rate = draw(st.sampled_from([10e3, 51.2e3, 1e6, 2.5e6]))
    duration = draw(st.integers(40, 150)) / rate
    kinds = draw(st.sampled_from(["named", "force", "named force", "response", "open"]))
    hammer = draw(st.sampled_from(TELLING if "named" in kinds else OPEN[:2]))
    unit = draw(st.sampled_from(["N", "kN", "lbf"] if "force" in kinds else ["", "g", "m/s^2"]))
    channels = [(hammer, unit, 100.0 * make_pulse(rate, duration, 1))]
    others = [*RESPONSES[:1]] if kinds == "response" else OPEN[2:]
    names = draw(st.lists(st.sampled_from([*others, *ACCELERATIONS]), unique=True, max_size=3))
    if kinds == "response":
        names = ["response"]
    for number, name in enumerate(names, 2):
        other = draw(st.sampled_from(["g", "m/s^2"])) if unit else ""
        channels.append((name, other, 20.0 * make_pulse(rate, 1.7 * duration, number)))
    lost = draw(st.sampled_from([0, 0, 1, 20]))
    suffix = draw(st.sampled_from([".csv", ".tdms", ".uff", ".mat", ".npz", ".parquet", ".txt"]))
    # `ch1_N` may be the fourteenth of its kind.
    hidden = {"open", "force"} if suffix == ".mat" else {"open"}
    return Written(
        f"hit{suffix}",
        draw(st.permutations(channels)),
        rate,
        duration,
        kinds not in hidden or len(channels) == 1,
        draw(st.sampled_from(["s", "ms", "us", ""])),
        0 if suffix in (".tdms", ".uff") else lost,
    )


def write(file: Written, folder: Path) -> Path:
    path = folder / file.name
    path.unlink(missing_ok=True)
    scale = {"s": 1.0, "ms": 1e3, "us": 1e6, "": 1e3}[file.unit]
    middle = round(0.3 * POINTS + 0.5 * file.duration * file.rate)
    kept = np.delete(np.arange(POINTS), slice(middle, middle + file.lost))
    times = scale * kept / file.rate
    columns = [(name, unit, values[kept]) for name, unit, values in file.channels]
    if path.suffix == ".tdms":
        with TdmsWriter(str(path)) as writer:
            writer.write_segment(
                [
                    ChannelObject("g", name, values, {
                        "wf_increment": 1.0 / file.rate if file.unit else 1.0,
                        "unit_string": unit,
                    })
                    for name, unit, values in columns
                ]
            )  # fmt: skip
    elif path.suffix == ".uff":
        for name, unit, values in columns:
            function = make_function(
                id1=name, data=values, x=times, ordinate_axis_units_lab=unit or "NONE",
                abscissa_axis_units_lab=file.unit or "NONE",
            )  # fmt: skip
            UFF(str(path)).write_sets([function], mode="add")
    else:
        heading = f"time ({file.unit})" if file.unit else "time"
        table = {heading: times}
        table |= {f"{name} ({unit})" if unit else name: values for name, unit, values in columns}
        _write_table(path, table, file.unit)
    return path


def _write_table(path: Path, table: dict[str, np.ndarray], unit: str) -> None:
    if path.suffix == ".npz":
        np.savez(path, **table)
    elif path.suffix == ".parquet":
        parquet.write_table(pa.table(table), path)
    elif path.suffix == ".mat":
        plain = {name.replace("m/s^2", "ms2"): values for name, values in table.items()}
        savemat(path, {re.sub(r"\W+", "_", name).strip("_"): of for name, of in plain.items()})
    else:
        sign = "," if path.suffix == ".csv" else "\t"
        np.savetxt(path, np.stack([*table.values()]).T, delimiter=sign, header=sign.join(table),
                   comments="")  # fmt: skip


@given(file=files())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_number_is_right_or_refused_or_something_is_said(tmp_path, file):
    path = write(file, tmp_path)
    try:
        found = MeasuredFiles([path], make_series(MeasurementOptions(cutoff=0.0)))
    except RigError:
        return
    if found.errors:
        (error,) = found.errors
        assert path.name in error
        if "points are missing" in error:
            assert file.lost
        return
    (value,) = [hit.contact_time for _, _, hits in judge(found.events()) for _, hit in hits]
    if value == pytest.approx(2 * 2 / 3 * file.duration, rel=0.03):
        assert not file.lost
        return
    (taken,) = found.taken
    assert not file.is_told
    assert not file.lost
    assert "by their places" in taken
