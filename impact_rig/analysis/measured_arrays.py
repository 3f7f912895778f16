"""Arrays of a person's own as hits of several samples."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from impact_rig.analysis.analyze import refuse_parts_of_full_scale
from impact_rig.analysis.measured_files import MeasuredHits, TraceSeries, check_control
from impact_rig.configuration.rig_file import read_rig_file
from impact_rig.configuration.units import Given, parse_sensitivity, read_carried, read_given
from impact_rig.core.given.errors import ParameterError, RigError, check_between
from impact_rig.core.given.records import IMPORTED, FloatArray, HitLabel, Origin
from impact_rig.core.given.sensors import (
    CHANNELS,
    FORCES,
    UNITS,
    VOLTAGES,
    Sensitivity,
    Sensor,
    normalize_unit,
)
from impact_rig.core.given.setup import RigSetup, Sample, SampleSet
from impact_rig.files.channels import map_channels
from impact_rig.files.measurement import MeasuredChannel, Measurement
from impact_rig.files.plan import ChannelPlan, ChannelUse
from impact_rig.files.raster import MINIMUM_POINTS
from impact_rig.files.times import RATE_MISMATCH, TIME_UNITS

RATES = 100.0, 1e12
"""Sampling rates that can be meant [Hz]: below them no contact has ten points."""
LARGEST_STEP_ERROR = 0.5
"""Error of a step between an array's times over the step [-]: more is a gap, less is rounding."""


def read_setup(
    samples: Mapping[str, Given] | None,
    hammer_mass: Given,
    control: str,
    rig_file: str | Path | None,
    *,
    accelerometer_mass: Given,
    hammer_stiffness: Given,
    hammer_sensitivity: str | None,
    specimen_sensitivity: str | None,
    sensitivity_uncertainty: float | None,
) -> RigSetup:
    """Return the set-up that a program describes; parameters and errors as of `api.Session`."""
    sensitivities = dict(zip(CHANNELS, (hammer_sensitivity, specimen_sensitivity), strict=True))
    others = (
        samples, hammer_mass, accelerometer_mass, control or None, hammer_stiffness,
        *sensitivities.values(), sensitivity_uncertainty,
    )  # fmt: skip
    if rig_file is not None:
        if any(item is not None for item in others):
            raise ParameterError(
                "a rig_file gives samples, masses, control sample and sensors: give it alone"
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
        sensors=tuple(
            _read_sensor(channel, text, sensitivity_uncertainty or 0.0)
            for channel, text in sensitivities.items()
            if text is not None or sensitivity_uncertainty
        ),
    )
    check_control(setup)
    return setup


def _read_sensor(channel: str, sensitivity: str | None, uncertainty: float) -> Sensor:
    """Return a sensor with its sensitivity, if there is one, and what that leaves of the gain."""
    sensor = Sensor(channel, sensitivity_uncertainty=uncertainty)
    if sensitivity is None:
        return sensor
    found = parse_sensitivity(f"{channel}_sensitivity", sensitivity)
    unit = normalize_unit(found.unit)
    quantity = "force" if unit in FORCES else "acceleration"
    return replace(sensor, quantity=quantity, unit=unit, sensitivity=found.voltage)


class MeasuredArrays(MeasuredHits):
    """Hits that come as arrays, of several samples.

    Parameters
    ----------
    settings : mapping
        Fields of `AnalysisSettings` in place of the set-up's.
    """

    def __init__(self, setup: RigSetup, settings: Mapping[str, float]) -> None:
        refuse_parts_of_full_scale(settings)
        setup = replace(setup, analysis=replace(setup.analysis, **settings))
        is_optional = "cutoff_frequency" not in settings
        series = TraceSeries("", ChannelPlan(), setup, is_filter_optional=is_optional)
        super().__init__(Path("session"), series)

    @property
    def hammer_unit(self) -> None:
        """None: all hits have the same unit."""

    def add_arrays(
        self,
        hammer: ArrayLike,
        specimen: ArrayLike | None,
        *,
        rate: Given,
        on: str,
        unit: str | None,
    ) -> None:
        """Take hits, all or none; parameters and errors as of `api.Session.add`."""
        self.setup.samples.find(on)
        bodies = {"hammer": take_traces("hammer", hammer, unit, "m/s^2")}
        if specimen is not None:
            (first, *_), known = bodies["hammer"], unit if unit and is_for_both(unit) else None
            usual = first.unit if is_for_both(first.unit) else "m/s^2"
            bodies["specimen"] = take_traces("specimen", specimen, known, usual)
        rates = [trace.rate for traces in bodies.values() for trace in traces]
        sampling_rate = choose_rate(_read("rate", rate, "Hz", "2.5 MHz"), rates)
        sizes = [[trace.values.size for trace in traces] for traces in bodies.values()]
        if sizes[0] != sizes[-1]:
            raise ParameterError(
                f"hammer has {sizes[0]!s:.40} points, specimen {sizes[-1]!s:.40}: a hit needs as"
                " many of both"
            )
        before = [*self.hits], self.series
        try:
            for place in range(len(sizes[0])):
                channels = (
                    MeasuredChannel(name, traces[place].values, sampling_rate, traces[place].unit)
                    for name, traces in bodies.items()
                )
                self._add_hit(on, tuple(channels))
        except RigError:
            self.hits, self.series = before
            self.__dict__.pop("setup", None)
            raise

    def _find_sensitivity(self, channel: str) -> Sensitivity:
        sensor = self.series.setup.find_sensor(channel)
        if math.isnan(sensor.sensitivity):
            raise ParameterError(
                f'{channel} is in V: Session needs its {channel}_sensitivity, like "10 mV/g"'
            )
        return Sensitivity(sensor.sensitivity, sensor.unit)

    def _add_hit(self, sample: str, channels: tuple[MeasuredChannel, ...]) -> None:
        number = len(self.hits) + 1
        attempts = Counter(hit.block.label.sample for hit in self.hits)
        units = {channel.name: channel.unit for channel in channels}
        uses = {
            name: ChannelUse(sensitivity=self._find_sensitivity(name))
            for name, unit in units.items()
            if unit in VOLTAGES
        }
        hammer, specimen = (uses.get(name, ChannelUse()) for name in CHANNELS)
        plan = ChannelPlan(hammer, specimen)
        (found,) = map_channels(
            Measurement(Path(f"hit {number}"), channels), plan, self.series.setup.hammer_mass
        )
        label = HitLabel(sample, number, attempts[sample] + 1)
        block = replace(
            found.block, label=label, origin=Origin(IMPORTED, "arrays"), first_sample=0
        )
        self.add(replace(found, block=block))


@dataclass(frozen=True)
class _Trace:
    """One hit of one channel."""

    values: FloatArray
    unit: str  # as `normalize_unit` writes it
    rate: float  # by its own times [Hz]; NaN: it has none


def is_for_both(unit: str) -> bool:
    """Return whether the sample's numbers may be in the hammer's unit: no force, then."""
    return normalize_unit(unit) not in FORCES


def take_traces(name: str, values: Any, unit: str | None, usual: str) -> list[_Trace]:
    """Return one hit's trace, or one for each row.

    Parameters
    ----------
    values : array_like
        Also with a unit (pint, astropy, xarray) or times (pandas, xarray) of its own.
    unit : str or None
        Stated; None: that which the values carry, else the usual one.

    Raises
    ------
    ParameterError
        If there are none, or what they carry contradicts the unit, or is uneven.
    """
    has_rows = isinstance(values, list | tuple) and len(values) > 0 and np.ndim(values[0]) > 0
    traces = []
    for item in values if has_rows else [values]:
        numbers, carried = _take_unit(name, item)
        if unit is not None and carried and carried != normalize_unit(unit):
            raise ParameterError(
                f"{name} is in {carried} by itself: unit is {unit!r}, leave it out"
            )
        found = normalize_unit(carried or unit or usual)
        if found not in UNITS:
            raise ParameterError(f"unit {found!r} is unknown: a channel is in {', '.join(UNITS)}")
        rate = _take_rate(name, item)
        rows = _take_array(name, numbers)
        for row in [rows] if has_rows else np.atleast_2d(rows):
            if row.ndim != 1 or row.size < MINIMUM_POINTS:
                raise ParameterError(
                    f"{name} has rows of shape {row.shape}: it must hold one hit, of"
                    f" {MINIMUM_POINTS} points or more, or a row of them for each hit"
                )
            traces.append(_Trace(row, found, rate))
    return traces


def _take_unit(name: str, values: Any) -> tuple[Any, str]:
    """Return numbers, and the unit that they carry; empty: they carry none."""
    if hasattr(values, "to") and (hasattr(values, "units") or hasattr(values, "unit")):
        for unit in ("m/s^2", "N", "V"):
            if (numbers := read_carried(values, unit)) is not None:
                return numbers, unit
        raise ParameterError(f"{name} is in {getattr(values, 'units', '')}: it must be in m/s^2")
    attributes = getattr(values, "attrs", {})  # of xarray and pandas
    return values, normalize_unit(str(attributes.get("units", "")))


def _take_rate(name: str, values: Any) -> float:
    """Return the sampling rate by the times that an array carries [Hz]; NaN: it has none."""
    times, unit = getattr(values, "index", None), "s"
    if hasattr(values, "coords") and getattr(values, "dims", None):
        times = values.coords.get(values.dims[-1])
        unit = str(getattr(times, "attrs", {}).get("units", unit))
    times = np.asarray(getattr(times, "values", None))
    if times.dtype.kind in "mM":
        times = (times - times[0]) / np.timedelta64(1, "ns") * 1e-9
    elif times.dtype.kind == "f" and unit in TIME_UNITS:
        times = times * TIME_UNITS[unit]
    else:  # none, or places are counted
        return math.nan
    steps = np.diff(times)
    usual = float(np.median(steps))
    if not usual > 0.0 or not np.all(np.abs(steps - usual) < LARGEST_STEP_ERROR * usual):
        raise ParameterError(
            f"{name} has times with a gap, or of uneven steps: all must be {usual:.6g} s"
        )
    return float((times.size - 1) / (times[-1] - times[0]))


def choose_rate(given: float, carried: Sequence[float]) -> float:
    """Return the sampling rate that is given, or that arrays carry [Hz]; NaN: not known.

    Raises
    ------
    ParameterError
        If there is none, they contradict each other, or it cannot be meant.
    """
    rates = [rate for rate in (given, *carried) if not math.isnan(rate)]
    if not rates:
        raise ParameterError('rate is not given: give it like "2.5 MHz"')
    for rate in rates:
        if not math.isclose(rate, rates[0], rel_tol=RATE_MISMATCH):
            raise ParameterError(
                f"rate is {rates[0]:g} Hz: by the times of the array it is {rate:.6g} Hz"
            )
    check_between("rate", rates[0], *RATES)
    return rates[0]


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
