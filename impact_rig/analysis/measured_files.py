"""What measured files are taken for, hits of one sample, and reading them so.

`import` and `analyze` ask for the same and read alike, so that both give the same numbers.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from impact_rig.configuration.import_file import ImportFile, add_options, read_import_file
from impact_rig.configuration.rig_file import read_rig_file
from impact_rig.core.checks import check_positive
from impact_rig.core.errors import ParameterError, RigError, SignalError
from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.hits.reasons import Reason
from impact_rig.core.hits.verdict import check_channels, check_stream
from impact_rig.core.setup.calibration import UNITS
from impact_rig.core.setup.samples import RigSetup, Sample, SampleSet
from impact_rig.core.setup.sensors import CHANNELS, ChannelPlan, Sensor
from impact_rig.core.signals.detection import ImpactDetector
from impact_rig.core.signals.filtering import check_cutoff, low_pass
from impact_rig.core.signals.record import HitLabel
from impact_rig.recordings.importing import (
    ImportedHit,
    check_series,
    choose_window,
    count_width,
    read_hits,
)
from impact_rig.results.numbers import format_count

DEFAULT_NAME = "sample"
MASSES = ("hammer_mass", "sample_mass", "accelerometer_mass")
WINDOW = ("pre_trigger", "record_duration")
FINE_POINTS = 100
"""Of a pulse at half amplitude, to see what the low-pass does to it [points], our choice."""
LONG_PULSE = 5.0
"""Width of a pulse over the period of the cutoff from which nothing happens to it [-]."""
WORTH_SAYING = 0.01
"""How much wider a pulse must become [-], our choice."""
USELESS = {Reason.NO_PULSE, Reason.NON_FINITE}
"""Reasons that a file is not a bad hit but no hit at all."""


@dataclass(frozen=True)
class TraceSeries:
    """What measured files are taken for: hits of one sample.

    Attributes
    ----------
    sample : str
        Name of the struck sample.
    plan : ChannelPlan
        Which channel is what.
    setup : RigSetup
        Masses and settings.
    has_window : bool
        Pre-trigger and duration of the records are given; False: each file is a record, whole.
    is_filter_optional : bool
        The low-pass is left out where the sampling is too slow for it; False: such a file is
        refused.
    """

    sample: str
    plan: ChannelPlan
    setup: RigSetup
    has_window: bool = False
    is_filter_optional: bool = False


def make_series(given: Mapping[str, Any], settings: Mapping[str, Any]) -> TraceSeries:
    """Return what files are taken for.

    Parameters
    ----------
    given : mapping
        Options of measured files as given: `channels`, a file that holds the others and goes
        after them; `rig_file` with masses and settings; those of `add_options`; `pre_trigger` and
        `record_duration` [s].
    settings : mapping
        Fields of `AnalysisSettings` to replace, by name.

    Raises
    ------
    ParameterError
        If options contradict each other, or a value cannot be meant.
    FileError
        If the rig file or the file of channels cannot be used.
    """
    left = dict(given)
    channels, rig_file = left.pop("channels", None), left.pop("rig_file", None)
    window = {name: left.pop(name) for name in WINDOW if name in left}
    file = ImportFile() if channels is None else read_import_file(channels)
    file = add_options(replace(file, settings={**file.settings, **settings, **window}), left)
    if not math.isnan(file.hammer_stiffness):
        check_positive("--hammer-stiffness", file.hammer_stiffness, "N/m")
        if file.control:
            raise ParameterError("--hammer-stiffness and --control both give k1: choose one")
    setup = _make_setup(file) if rig_file is None else _read_setup(rig_file, file)
    return TraceSeries(
        file.sample or DEFAULT_NAME,
        file.plan,
        replace(
            setup,
            hammer_stiffness=file.hammer_stiffness,
            analysis=replace(setup.analysis, **file.settings),
            sensors=_add_responses(setup.sensors, file.plan),
        ),
        has_window=any(name in file.settings for name in WINDOW),
        is_filter_optional=rig_file is None and "cutoff_frequency" not in file.settings,
    )


def _read_setup(path: Path, file: ImportFile) -> RigSetup:
    if file.control or not all(math.isnan(getattr(file, mass)) for mass in MASSES):
        raise ParameterError(
            "--rig-file gives the masses and the control sample: leave out --hammer-mass,"
            " --sample-mass, --accelerometer-mass and --control"
        )
    setup = read_rig_file(path).setup
    if not file.sample:
        names = ", ".join(map(repr, setup.samples.names))
        raise ParameterError(f"--rig-file needs --sample, one of {names}")
    setup.samples.find(file.sample)
    return setup


def _make_setup(file: ImportFile) -> RigSetup:
    """Return the set-up that the masses make, NaN where they are not known."""
    name = file.sample or DEFAULT_NAME
    if file.control and math.isnan(file.hammer_mass + file.sample_mass):
        raise ParameterError("--control needs both masses: --hammer-mass and --sample-mass")
    carried = file.accelerometer_mass
    samples = SampleSet(
        (Sample(name, file.sample_mass),),
        control_sample=name if file.control else "",
        accelerometer_mass=0.0 if math.isnan(carried) else carried,
    )
    # Of speed and clock nobody said anything.
    return RigSetup(
        samples, file.hammer_mass, math.nan, description=file.description, clock_uncertainty=0.0
    )


def _add_responses(sensors: tuple[Sensor, ...], plan: ChannelPlan) -> tuple[Sensor, ...]:
    """Return the sensors of a set-up with the responses that a plan states."""
    known = {sensor.channel: sensor for sensor in sensors}
    for channel, use in zip(CHANNELS, (plan.hammer, plan.specimen), strict=True):
        if not use.response.is_flat:
            known[channel] = replace(
                known.get(channel, Sensor(channel)),
                resonance=use.response.resonance,
                resonance_damping=use.response.damping,
                low_corner=use.response.low_corner,
            )
    return tuple(known[channel] for channel in CHANNELS if channel in known)


def read_series(
    paths: Sequence[Path], series: TraceSeries, *, needs_scale: bool
) -> tuple[list[ImportedHit], RigSetup, dict[Path, str], tuple[str, ...]]:
    """Read every file.

    Parameters
    ----------
    paths : sequence of Path
        A file's place, counted from 1, is the record of its hit; several hits in a file move those
        after it on.
    series : TraceSeries
        What they are taken for; with a window, each impact in a file is a hit.
    needs_scale : bool
        Refuse a force without a mass.

    Returns
    -------
    tuple
        The hits, the set-up that they are judged by, a sentence for each file that could not be
        used, and remarks on what was taken for granted.
    """
    hits: list[ImportedHit] = []
    errors: dict[Path, str] = {}
    wanted = series.setup.analysis.cutoff_frequency
    moved = 0
    for number, path in enumerate(paths, start=1):
        label = HitLabel(series.sample, record=number + moved, impact=number + moved)
        analysis, mass = series.setup.analysis, series.setup.hammer_mass
        window = analysis if series.has_window else None
        try:
            found = read_hits(
                path, label, series.plan, mass, needs_scale=needs_scale, window=window
            )
            moved += len(found) - 1
            if needs_scale and not found[0].unit:
                raise SignalError(
                    f"{path}: nobody states the unit of the hammer's channel: give --hammer-unit,"
                    f" one of {', '.join(UNITS)}; `impact-rig analyze` takes it as it is"
                )
            for hit in found:
                series = _check_cutoff(hit, series)
                _check_pulse(hit, _make_series_setup(series, [hit]))
                check_series(hits, hit)
                hits.append(hit)
        except RigError as error:
            errors[path] = str(error)
    setup = _make_series_setup(series, hits)
    remarks = [remark for hit in hits for remark in hit.remarks]
    if hits:
        remarks += _describe_filter(wanted, setup.analysis.cutoff_frequency, hits)
    return hits, setup, errors, tuple(dict.fromkeys(remarks))


def join_errors(errors: Mapping[Path, str]) -> list[str]:
    """Return the sentences of `read_series`, one for all files that suffer from the same."""
    alike: dict[str, list[Path]] = {}
    for path, error in errors.items():
        alike.setdefault(error.removeprefix(str(path)), []).append(path)
    return [
        f"{files[0]} and {format_count(len(files) - 1, 'other')}{text}"
        if len(files) > 1
        else errors[files[0]]
        for text, files in alike.items()
    ]


def _make_series_setup(series: TraceSeries, hits: Sequence[ImportedHit]) -> RigSetup:
    """Return the set-up of a series, each file a record if nothing else is given."""
    setup = series.setup
    if hits and all(hit.unit == "N" for hit in hits):
        force = replace(setup.find_sensor("hammer"), quantity="force", unit="N")
        others = tuple(sensor for sensor in setup.sensors if sensor.channel != "hammer")
        setup = replace(setup, sensors=(force, *others))
    if series.has_window or not hits:
        return setup
    return replace(setup, analysis=choose_window(setup.analysis, hits))


def _check_cutoff(hit: ImportedHit, series: TraceSeries) -> TraceSeries:
    """Return the series, its low-pass left out if that may be and must be."""
    analysis = series.setup.analysis
    try:
        check_cutoff(analysis.cutoff_frequency, hit.block.sampling_rate)
    except ParameterError as error:
        if not series.is_filter_optional:
            raise ParameterError(f"{hit.path}: {error} (--cutoff off)") from None
        analysis = replace(analysis, cutoff_frequency=0.0)
    return replace(series, setup=replace(series.setup, analysis=analysis))


def _describe_filter(wanted: float, cutoff: float, hits: Sequence[ImportedHit]) -> list[str]:
    """Say what became of the low-pass that was wanted [Hz], and what it does to such pulses."""
    rate = hits[0].block.sampling_rate
    if cutoff != wanted:
        names = f"{rate / 1e3:g} kHz is too slow for the {wanted / 1e3:g} kHz low-pass"
        return [f"{names}: there is none (--cutoff)"]
    width = float(np.median([count_width(hit.block.hammer.output) for hit in hits])) / rate
    if not cutoff or width * cutoff > LONG_PULSE:
        return []
    # A versed-sine as wide at half amplitude, with room for the filter on both sides.
    time = np.linspace(-20.0, 20.0, 20 * FINE_POINTS * 2 + 1)
    pulse = np.where(np.abs(time) < 1.0, np.cos(0.5 * np.pi * time) ** 2, 0.0)
    filtered = low_pass(pulse, cutoff, FINE_POINTS / width)
    wider = measure_pulse(filtered).half_amplitude_width / FINE_POINTS - 1.0
    if wider < WORTH_SAYING:
        return []
    pulses = f"pulses of {width * 1e6:.3g} µs at half amplitude"
    return [
        f"the {cutoff / 1e3:g} kHz low-pass makes {pulses} {wider * 100:.0f} % wider (--cutoff)"
    ]


def _check_pulse(hit: ImportedHit, setup: RigSetup) -> None:
    """Require more than a bad hit: a pulse, or a dead channel beside a live one."""
    for record in ImpactDetector(setup.analysis).feed(hit.block):
        for rejection in check_stream(record) + check_channels(record, setup.analysis):
            if rejection.reason in USELESS:
                raise SignalError(
                    f"{hit.path} has no pulse that could be measured: {rejection.explanation}; it"
                    " must leave its baseline and come back"
                )
