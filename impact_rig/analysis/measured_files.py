"""Measured files as hits of one sample.

`import` and `analyze` ask for the same and read alike, so that both give the same numbers.
"""

import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np

from impact_rig.configuration.rig_file import read_rig_file
from impact_rig.core.given.errors import ParameterError, RigError, SignalError
from impact_rig.core.given.filtering import check_cutoff
from impact_rig.core.given.findings import Reason
from impact_rig.core.given.records import Block, HitLabel, Truth
from impact_rig.core.given.sensors import CHANNELS, Sensor
from impact_rig.core.given.setup import RigSetup, Sample, SampleSet
from impact_rig.core.hit.detection import ImpactDetector
from impact_rig.core.hit.overrules import NO_OVERRULES
from impact_rig.core.hit.verdict import check_channels, check_stream
from impact_rig.files.channels import MeasuredHit
from impact_rig.files.import_file import (
    ImportFile,
    MeasurementOptions,
    add_options,
    read_analysis_settings,
    read_import_file,
)
from impact_rig.files.importing import check_series, choose_window, read_hits
from impact_rig.files.plan import ChannelPlan
from impact_rig.results.numbers import format_count

DEFAULT_NAME = "sample"
MASSES = ("hammer_mass", "sample_mass", "accelerometer_mass")
"""Keys of masses in a file of channels, each with its `_uncertainty`."""
WINDOW = ("pre_trigger", "record_duration")
CUT = "a hit is double: if its file holds several hits, --record-duration 20ms makes one of each"
FASTEST, STRONGEST = 10.0, 5e4
"""Change of a hammer's speed [m/s] and force [N] above which masses or units are doubted, our
choice: a fall of five metres, twice a sledge hammer's."""
USELESS = {Reason.NO_PULSE, Reason.NON_FINITE}
"""Reasons that a file is not a bad hit but no hit at all."""


@dataclass(frozen=True)
class TraceSeries:
    """Measured files as hits of one sample."""

    sample: str  # name of the struck sample
    plan: ChannelPlan  # the roles of the channels
    setup: RigSetup  # masses and settings
    has_window: bool = False  # pre-trigger and duration are given; False: a file is one record
    # The low-pass is left out where the sampling is too slow for it; else such a file is refused.
    is_filter_optional: bool = False


def make_series(options: MeasurementOptions) -> TraceSeries:
    """Return files as hits of one sample.

    Raises
    ------
    ParameterError
        If options contradict each other, or a value cannot be meant.
    FileError
        If the rig file or the file of channels cannot be used.
    """
    rig_file = options.rig_file
    file = ImportFile() if options.channels is None else read_import_file(options.channels)
    file = add_options(file, options)
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


def make_recorded_settings(options: MeasurementOptions) -> dict[str, float]:
    """Return the analysis settings to use in place of recorded ones, by name.

    Parameters and errors as of `make_series`; a recording states all else itself.
    """
    for name in {*options.given} - {"channels", "cutoff"}:
        raise ParameterError(
            f"--{name.replace('_', '-')} is for plain traces: a recording explains itself"
        )
    settings = {} if options.channels is None else read_analysis_settings(options.channels)
    if options.cutoff is not None:
        settings["cutoff_frequency"] = options.cutoff
    return settings


def _read_setup(path: Path, file: ImportFile) -> RigSetup:
    given = [
        not math.isnan(getattr(file, mass)) or getattr(file, f"{mass}_uncertainty")
        for mass in MASSES
    ]
    if file.control or any(given):
        raise ParameterError(
            "the rig file gives the masses and the control sample: give it alone, also in the file"
            " of channels"
        )
    setup = read_rig_file(path).setup
    if not file.sample:
        names = ", ".join(map(repr, setup.samples.names))
        raise ParameterError(f"the rig file needs the name of the sample, one of {names}")
    setup.samples.find(file.sample)
    return setup


def _make_setup(file: ImportFile) -> RigSetup:
    """Return the set-up that the masses make, NaN where they are not known."""
    name = file.sample or DEFAULT_NAME
    carried = file.accelerometer_mass
    samples = SampleSet(
        (Sample(name, file.sample_mass, mass_uncertainty=file.sample_mass_uncertainty),),
        control_sample=name if file.control else "",
        accelerometer_mass=0.0 if math.isnan(carried) else carried,
        accelerometer_mass_uncertainty=file.accelerometer_mass_uncertainty,
    )
    # Speed and clock are not stated.
    setup = RigSetup(
        samples,
        file.hammer_mass,
        math.nan,
        description=file.description,
        clock_uncertainty=0.0,
        hammer_mass_uncertainty=file.hammer_mass_uncertainty,
        hammer_stiffness=file.hammer_stiffness,
    )
    check_control(setup)
    return setup


def check_control(setup: RigSetup) -> None:
    """Refuse a control sample that gives no k1, or not the only one."""
    control = setup.samples.control_sample
    if control and not math.isnan(setup.hammer_stiffness):
        raise ParameterError(
            "the hammer's stiffness and a control sample both give k1: choose one"
        )
    if control and setup.find_unknown_masses(control):
        raise ParameterError("a control sample needs both masses, its own and the hammer's")


def _add_responses(sensors: tuple[Sensor, ...], plan: ChannelPlan) -> tuple[Sensor, ...]:
    """Return the sensors of a set-up with what a plan states of them."""
    known = {sensor.channel: sensor for sensor in sensors}
    for channel, use in zip(CHANNELS, (plan.hammer, plan.specimen), strict=True):
        if use.stated:
            known[channel] = replace(known.get(channel, Sensor(channel)), **use.stated)
    return tuple(known[channel] for channel in CHANNELS if channel in known)


class MeasuredHits:
    """Hits of other instruments, in memory, which are added one by one.

    Parameters
    ----------
    path : Path
        What a person named.
    series : TraceSeries
        What they are taken for.
    """

    size = 0

    def __init__(self, path: Path, series: TraceSeries) -> None:
        self.path = path
        self.truths: dict[HitLabel, Truth] = {}
        self.verdicts: dict[HitLabel, bool] = {}
        self.overrules = NO_OVERRULES
        self.hits: list[MeasuredHit] = []
        self.series = series
        self._wanted = series.setup.analysis.cutoff_frequency

    def add(self, hit: MeasuredHit) -> None:
        """Take a hit.

        Raises
        ------
        SignalError
            If it has no pulse, or no mean can be taken with those before.
        ParameterError
            If it is too slow for the low-pass.
        """
        series = _check_cutoff(hit, self.series)
        _check_pulse(hit, _make_series_setup(series, [hit]))
        sample = hit.block.label.sample
        check_series([one for one in self.hits if one.block.label.sample == sample], hit)
        self.series = series
        self.hits.append(hit)
        self.__dict__.pop("setup", None)

    @cached_property
    def setup(self) -> RigSetup:
        """Masses and settings; unless they are given, each hit is one record."""
        return _make_series_setup(self.series, self.hits)

    @property
    def has_scale(self) -> bool:
        """Whether the hammer's numbers make accelerations."""
        return all(hit.has_scale for hit in self.hits)

    @property
    def hammer_unit(self) -> str | None:
        """Unit that the hammer's sensor measures; empty: it is not stated."""
        return self.hits[0].unit if self.hits else ""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings for the user."""
        remarks = [remark for hit in self.hits for remark in hit.remarks]
        if self.hits and self.setup.analysis.cutoff_frequency != self._wanted:
            rate = self.hits[0].block.sampling_rate / 1e3
            remarks.append(
                f"{rate:g} kHz is too slow for the {self._wanted / 1e3:g} kHz low-pass:"
                " there is none, since no cutoff was asked for"
            )
        return tuple(dict.fromkeys((*remarks, *self.doubts)))

    @property
    def doubts(self) -> list[str]:
        """What no hammer does."""
        known = self.hits[:1] if self.has_scale else ()
        return [text for hit in known for text in _doubt(hit.block, self.setup.hammer_mass)]

    def advise(self, reasons: Collection[Reason]) -> tuple[str, ...]:
        """Return advice for hits that were rejected for these reasons."""
        return (CUT,) if Reason.DOUBLE_HIT in reasons and not self.series.has_window else ()

    def events(self, _report: Callable[[int], None] = lambda _: None) -> Self:
        """Begin a reading: of hits in memory nothing has to be kept."""
        return self

    def __iter__(self) -> Iterator[RigSetup | Block]:
        """Yield the set-up and the hits."""
        yield self.setup
        for hit in self.hits:
            yield hit.block


class MeasuredFiles(MeasuredHits):
    """Plain files as hits of one sample.

    Parameters
    ----------
    paths : sequence of Path
        A file's place, counted from 1, is the record of its hit; several hits in a file move those
        after it on.
    series : TraceSeries
        What they are taken for; with a window, each impact in a file is a hit.
    needs_scale : bool
        Refuse a force without a mass.
    """

    def __init__(
        self, paths: Sequence[Path], series: TraceSeries, *, needs_scale: bool = False
    ) -> None:
        super().__init__(paths[0], series)
        errors: dict[Path, str] = {}
        moved = 0
        for number, path in enumerate(paths, start=1):
            label = HitLabel(series.sample, record=number + moved, impact=number + moved)
            analysis, mass = self.series.setup.analysis, series.setup.hammer_mass
            window = analysis if series.has_window else None
            try:
                found = read_hits(
                    path, label, series.plan, mass, needs_scale=needs_scale, window=window
                )
                moved += len(found) - 1
                for hit in found:
                    self.add(hit)
            except RigError as error:
                errors[path] = str(error)
        self.errors = _join_errors(errors)  # a sentence for each file, or for all with the same
        self.taken = _join_alike([hit.taken for hit in self.hits])


def _doubt(block: Block, hammer_mass: float) -> list[str]:
    """Return a remark if the hammer does what none does."""
    acceleration = block.hammer.acceleration - np.median(block.hammer.acceleration)
    place = int(np.argmax(np.abs(acceleration)))
    inside = np.abs(acceleration) > 0.1 * np.abs(acceleration[place])
    speed = float(np.abs(acceleration[inside].sum())) / block.sampling_rate
    force = hammer_mass * float(np.abs(acceleration[place]))
    if not (speed > FASTEST or force > STRONGEST):
        return []
    also = "" if math.isnan(force) else f", and the force is {force / 1e3:.3g} kN"
    text = f"a hit changes the hammer's speed by {speed:.3g} m/s{also}: no hammer does that"
    return [f"{text}; are the unit and the masses right?"]


def _join_alike(lines: Sequence[str]) -> list[str]:
    """Return lines that differ by numbers alone once, each with how many are like it."""
    alike: dict[str, list[str]] = {}
    for line in dict.fromkeys(lines):
        alike.setdefault(re.sub(r"\d+", "#", line), []).append(line)
    return [
        found[0] + (f" (and {format_count(len(found) - 1, 'hit')} alike)" if found[1:] else "")
        for found in alike.values()
    ]


def _join_errors(errors: Mapping[Path, str]) -> list[str]:
    """Return a sentence for all files that suffer from the same."""
    alike: dict[str, list[Path]] = {}
    for path, error in errors.items():
        alike.setdefault(error.removeprefix(str(path)), []).append(path)
    return [
        f"{files[0]} and {format_count(len(files) - 1, 'other')}{text}"
        if len(files) > 1
        else errors[files[0]]
        for text, files in alike.items()
    ]


def _make_series_setup(series: TraceSeries, hits: Sequence[MeasuredHit]) -> RigSetup:
    """Return the set-up of a series, each file a record if nothing else is given."""
    setup = series.setup
    if hits and all(hit.unit == "N" for hit in hits):
        force = replace(setup.find_sensor("hammer"), quantity="force", unit="N")
        others = tuple(sensor for sensor in setup.sensors if sensor.channel != "hammer")
        setup = replace(setup, sensors=(force, *others))
    if series.has_window or not hits:
        return setup
    return replace(setup, analysis=choose_window(setup.analysis, hits))


def _check_cutoff(hit: MeasuredHit, series: TraceSeries) -> TraceSeries:
    """Return the series, its low-pass left out if that may be and must be."""
    analysis = series.setup.analysis
    try:
        check_cutoff(analysis.cutoff_frequency, hit.block.sampling_rate)
    except ParameterError as error:
        if not series.is_filter_optional:
            raise ParameterError(f"{hit.path}: {error}") from None
        analysis = replace(analysis, cutoff_frequency=0.0)
    return replace(series, setup=replace(series.setup, analysis=analysis))


def _check_pulse(hit: MeasuredHit, setup: RigSetup) -> None:
    """Refuse a trace that holds no pulse at all: it is not even a bad hit."""
    for record in ImpactDetector(setup.analysis).feed(hit.block):
        for rejection in check_stream(record) + check_channels(record):
            if rejection.reason in USELESS:
                raise SignalError(
                    f"{hit.path} has no pulse that could be measured: {rejection.explanation}; it"
                    " must leave its baseline and come back"
                )
