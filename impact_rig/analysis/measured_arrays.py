"""Arrays of a person's own as hits of several samples."""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from impact_rig.analysis.measured_files import MeasuredHits, TraceSeries, check_control
from impact_rig.configuration.rig_file import read_rig_file
from impact_rig.configuration.units import Given, read_given
from impact_rig.core.given.errors import ParameterError, RigError, check_between
from impact_rig.core.given.records import IMPORTED, FloatArray, HitLabel, Origin
from impact_rig.core.given.sensors import FORCES, compute_scale, normalize_unit
from impact_rig.core.given.setup import RigSetup, Sample, SampleSet
from impact_rig.files.channels import map_channels
from impact_rig.files.measurement import MeasuredChannel, Measurement
from impact_rig.files.plan import ChannelPlan
from impact_rig.files.raster import MINIMUM_POINTS

RATES = 100.0, 1e12
"""Sampling rates that can be meant [Hz]: below them no contact has ten points."""


def read_setup(
    samples: Mapping[str, Given] | None,
    hammer_mass: Given,
    accelerometer_mass: Given,
    control: str,
    hammer_stiffness: Given,
    rig_file: str | Path | None,
) -> RigSetup:
    """Return the set-up that a program describes; parameters and errors as of `api.Session`."""
    others = samples, hammer_mass, accelerometer_mass, control or None, hammer_stiffness
    if rig_file is not None:
        if others.count(None) < len(others):
            raise ParameterError(
                "a rig_file gives samples, masses and control sample: give it alone"
            )
        return read_rig_file(Path(rig_file)).setup
    if not isinstance(samples, Mapping) or not all(isinstance(name, str) for name in samples):
        raise ParameterError(
            f"samples is {samples!r}: it must give each sample's mass, like"
            ' {"steel": "56.32 g"}; or give a rig_file'
        )
    masses = (
        Sample(name, _read(f"mass of {name}", mass, "kg", "100 g"))
        for name, mass in samples.items()
    )
    carried = read_given("accelerometer_mass", accelerometer_mass, "kg", "3 g") or 0.0
    setup = RigSetup(
        SampleSet(tuple(masses), control, carried),
        _read("hammer_mass", hammer_mass, "kg", "100 g"),
        math.nan,
        clock_uncertainty=0.0,
        hammer_stiffness=_read("hammer_stiffness", hammer_stiffness, "N/m", "22.5 MN/m"),
    )
    check_control(setup)
    return setup


class MeasuredArrays(MeasuredHits):
    """Hits that come as arrays, of several samples.

    Parameters
    ----------
    settings : mapping
        Fields of `AnalysisSettings` in place of the set-up's.
    """

    def __init__(self, setup: RigSetup, settings: Mapping[str, float]) -> None:
        setup = replace(setup, analysis=replace(setup.analysis, **settings))
        is_optional = "cutoff_frequency" not in settings
        series = TraceSeries("", ChannelPlan(), setup, is_filter_optional=is_optional)
        super().__init__(Path("session"), series)

    @property
    def hammer_unit(self) -> None:
        """No hit is described by itself."""

    def add_arrays(
        self, hammer: ArrayLike, specimen: ArrayLike | None, *, rate: Given, on: str, unit: str
    ) -> None:
        """Take hits, all or none; parameters and errors as of `api.Session.add`."""
        self.setup.samples.find(on)
        sampling_rate = _read("rate", rate, "Hz", "2.5 MHz")
        check_between("rate", sampling_rate, *RATES)
        compute_scale(str(unit), mass=1.0)  # refuses a unit that is none
        bodies = {"hammer": (take_traces("hammer", hammer), unit)}
        if specimen is not None:
            other = "m/s^2" if normalize_unit(unit) in FORCES else unit
            bodies["specimen"] = (take_traces("specimen", specimen), other)
        sizes = [[trace.size for trace in traces] for traces, _ in bodies.values()]
        if sizes[0] != sizes[-1]:
            raise ParameterError(
                f"hammer has {sizes[0]!s:.40} points, specimen {sizes[-1]!s:.40}: a hit needs as"
                " many of both"
            )
        before = [*self.hits], self.series
        try:
            for place in range(len(sizes[0])):
                channels = (
                    MeasuredChannel(name, traces[place], sampling_rate, of)
                    for name, (traces, of) in bodies.items()
                )
                self._add_hit(on, tuple(channels))
        except RigError:
            self.hits, self.series = before
            self.__dict__.pop("setup", None)
            raise

    def _add_hit(self, sample: str, channels: tuple[MeasuredChannel, ...]) -> None:
        number = len(self.hits) + 1
        attempts = Counter(hit.block.label.sample for hit in self.hits)
        (found,) = map_channels(
            Measurement(Path(f"hit {number}"), channels),
            self.series.plan,
            self.series.setup.hammer_mass,
        )
        label = HitLabel(sample, number, attempts[sample] + 1)
        block = replace(
            found.block, label=label, origin=Origin(IMPORTED, "arrays"), first_sample=0
        )
        self.add(replace(found, block=block))


def take_traces(name: str, values: Any) -> list[FloatArray]:
    """Return one hit's trace, or one for each row; raises `ParameterError` if there are none."""
    has_rows = isinstance(values, list | tuple) and len(values) > 0 and np.ndim(values[0]) > 0
    rows = [_take_array(name, row) for row in (values if has_rows else [values])]
    if not has_rows:
        rows = [*np.atleast_2d(*rows)]
    for row in rows:
        if row.ndim != 1 or row.size < MINIMUM_POINTS:
            raise ParameterError(
                f"{name} has rows of shape {row.shape}: it must hold one hit, of {MINIMUM_POINTS}"
                " points or more, or a row of them for each hit"
            )
    return rows


def _take_array(name: str, values: Any) -> FloatArray:
    if np.ma.is_masked(values):
        raise ParameterError(f"{name} has masked points: every point must be known")
    try:
        array = np.asarray(values)
        if array.dtype.kind in "iufO":
            return array.astype(np.float64)
    except (TypeError, ValueError):
        pass
    raise ParameterError(f"{name} is {values!r:.40}: it must be an array of real numbers")


def _read(what: str, value: Given, unit: str, example: str) -> float:
    found = read_given(what, value, unit, example)
    return math.nan if found is None else found
