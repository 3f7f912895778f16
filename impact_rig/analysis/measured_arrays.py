"""Arrays of a person's own as hits of several samples."""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from impact_rig.analysis.measured_files import MeasuredHits, TraceSeries
from impact_rig.configuration.rig_file import read_rig_file, read_settings
from impact_rig.configuration.units import Given, read_given
from impact_rig.core.errors import ParameterError
from impact_rig.core.records import IMPORTED, FloatArray, HitLabel, Origin
from impact_rig.core.setup import RigSetup, Sample, SampleSet
from impact_rig.files.channels import map_channels
from impact_rig.files.measurement import MeasuredChannel, Measurement
from impact_rig.files.plan import ChannelPlan


class MeasuredArrays(MeasuredHits):
    """Hits that come as arrays, of several samples; parameters and errors as of `api.Session`."""

    def __init__(
        self,
        samples: Mapping[str, Given] | None,
        *,
        hammer_mass: Given,
        accelerometer_mass: Given,
        control: str,
        hammer_stiffness: Given,
        rig_file: str | Path | None,
        cutoff: Given,
        **settings: Given,
    ) -> None:
        chosen = read_settings({"cutoff_frequency": cutoff, **settings})
        if (samples is None) == (rig_file is None):
            raise ParameterError("a session needs either samples with their masses or a rig_file")
        if rig_file is not None:
            setup = read_rig_file(Path(rig_file)).setup
        else:
            masses = (Sample(name, _read(f"mass of {name}", mass, "kg", "100 g"))
                      for name, mass in (samples or {}).items())  # fmt: skip
            carried = read_given("accelerometer_mass", accelerometer_mass, "kg", "3 g") or 0.0
            setup = RigSetup(
                SampleSet(tuple(masses), control, carried),
                _read("hammer_mass", hammer_mass, "kg", "100 g"),
                math.nan,
                clock_uncertainty=0.0,
                hammer_stiffness=_read("hammer_stiffness", hammer_stiffness, "N/m", "22.5 MN/m"),
            )
        setup = replace(setup, analysis=replace(setup.analysis, **chosen))
        series = TraceSeries("", ChannelPlan(), setup, is_filter_optional=cutoff is None)
        super().__init__(Path("arrays"), series)

    @property
    def hammer_unit(self) -> None:
        """No hit is described by itself."""

    def add_arrays(
        self, hammer: ArrayLike, specimen: ArrayLike | None, *, rate: Given, on: str, unit: str
    ) -> None:
        """Take a hit; parameters and errors as of `api.Session.add`."""
        self.setup.samples.find(on)
        number = len(self.hits) + 1
        attempts = Counter(hit.block.label.sample for hit in self.hits)
        bodies = {"hammer": (hammer, unit)}
        if specimen is not None:
            bodies["specimen"] = (specimen, "m/s^2" if unit == "N" else unit)
        sampling_rate = _read("rate", rate, "Hz", "2.5 MHz")
        channels = tuple(
            MeasuredChannel(name, take_array(name, values), sampling_rate, of)
            for name, (values, of) in bodies.items()
        )
        (found,) = map_channels(
            Measurement(Path(f"hit {number}"), channels),
            self.series.plan,
            self.series.setup.hammer_mass,
            needs_scale=True,
        )
        block = replace(
            found.block,
            label=HitLabel(on, number, attempts[on] + 1),
            origin=Origin(IMPORTED, "arrays"),
            last=True,
            first_sample=0,
        )
        self.add(replace(found, block=block))


def take_array(name: str, values: ArrayLike) -> FloatArray:
    """Return numbers as an array; raises `ParameterError` if they are none."""
    if np.ma.is_masked(values):
        raise ParameterError(f"{name} has masked points: every point must be known")
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ParameterError(f"{name} is {values!r:.40}: it must be an array of numbers") from None


def _read(what: str, value: Given, unit: str, example: str) -> float:
    found = read_given(what, value, unit, example)
    return math.nan if found is None else found
