"""Plain traces through the core: one file, one hit, all of one sample.

They take the way of a recording, so that their import gives the same numbers.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from impact_rig.analysis.recording_analysis import SettingsChanges, describe_hit
from impact_rig.configuration.import_file import ImportFile, read_import_file
from impact_rig.configuration.rig_file import read_rig_file
from impact_rig.core.checks import check_positive
from impact_rig.core.errors import ParameterError, RigError, SignalError
from impact_rig.core.estimation.contact_law import ContactLaw
from impact_rig.core.estimation.paper_method import HammerEstimate
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.hits.hit import JudgedHit, judge_hit
from impact_rig.core.hits.overrule import Overrules, describe_label
from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.hits.reasons import Reason
from impact_rig.core.hits.verdict import check_channels, check_stream
from impact_rig.core.quantity import UNKNOWN
from impact_rig.core.session import Session
from impact_rig.core.setup.calibration import Sensitivity
from impact_rig.core.setup.samples import RigSetup, Sample, SampleSet
from impact_rig.core.setup.sensors import (
    CHANNELS,
    ChannelPlan,
    ChannelUse,
    Sensor,
    SensorResponse,
)
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
from impact_rig.results.campaign import Results, results_from_session
from impact_rig.results.trace_series import TraceResults

DEFAULT_NAME = "sample"
MASSES = ("hammer_mass", "sample_mass", "accelerometer_mass")


@dataclass(frozen=True)
class TraceOptions:
    """The options of measured files as given; None: not given.

    Attributes
    ----------
    channels : Path or None
        File that holds all of this, and goes after it.
    hammer, specimen : str or None
        Names or numbers of the channels.
    columns : str or None
        Roles, separated by commas.
    rate : float or None
        Sampling rate [Hz].
    time_unit : str or None
        Of a column of times.
    hammer_unit, sample_unit : str or None
        Of the channels.
    hammer_sensitivity, sample_sensitivity : Sensitivity or None
        Of channels in V.
    hammer_full_scale, sample_full_scale : tuple of float and str, or None
        Largest value, with its unit.
    hammer_resonance, sample_resonance, hammer_low_corner, sample_low_corner : float or None
        Of the sensors [Hz].
    hammer_resonance_damping, sample_resonance_damping : float or None
        Of the sensors, over critical [-].
    sample : str or None
        Name of the struck sample.
    rig_file : Path or None
        Masses and settings.
    hammer_mass, sample_mass, accelerometer_mass : float or None
        [kg]
    hammer_stiffness : float or None
        k1 [N/m].
    control : bool
        Hammer and sample are alike.
    """

    channels: Path | None = None
    hammer: str | None = None
    specimen: str | None = None
    columns: str | None = None
    rate: float | None = None
    time_unit: str | None = None
    hammer_unit: str | None = None
    sample_unit: str | None = None
    hammer_sensitivity: Sensitivity | None = None
    sample_sensitivity: Sensitivity | None = None
    hammer_full_scale: tuple[float, str] | None = None
    sample_full_scale: tuple[float, str] | None = None
    hammer_resonance: float | None = None
    sample_resonance: float | None = None
    hammer_resonance_damping: float | None = None
    sample_resonance_damping: float | None = None
    hammer_low_corner: float | None = None
    sample_low_corner: float | None = None
    sample: str | None = None
    rig_file: Path | None = None
    hammer_mass: float | None = None
    sample_mass: float | None = None
    accelerometer_mass: float | None = None
    hammer_stiffness: float | None = None
    control: bool = False

    def make_series(self, changes: SettingsChanges) -> "TraceSeries":
        """Return what the files are taken for.

        Raises
        ------
        ParameterError
            If options contradict each other, or a value cannot be meant.
        FileError
            If the rig file or the file of channels cannot be used.
        """
        file = ImportFile() if self.channels is None else read_import_file(self.channels)
        name = self.sample or file.sample
        setup = (
            self._make_setup(file, name or DEFAULT_NAME)
            if self.rig_file is None
            else self._read_setup(self.rig_file, file, name)
        )
        stiffness = file.hammer_stiffness
        if self.hammer_stiffness is not None:
            stiffness = self.hammer_stiffness
            check_positive("--hammer-stiffness", stiffness, "N/m")
        if not math.isnan(stiffness) and (self.control or file.control):
            raise ParameterError("--hammer-stiffness and --control both give k1: choose one")
        analysis = changes.apply(replace(setup.analysis, **file.settings))
        plan = self._make_plan(file.plan)
        return TraceSeries(
            name or DEFAULT_NAME,
            plan,
            replace(
                setup,
                hammer_stiffness=stiffness,
                analysis=analysis,
                sensors=_add_responses(setup.sensors, plan),
            ),
            has_window="pre_trigger" in file.settings or "record_duration" in file.settings,
            is_filter_optional=changes.cutoff_frequency is None
            and self.rig_file is None
            and "cutoff_frequency" not in file.settings,
        )

    def _make_plan(self, plan: ChannelPlan) -> ChannelPlan:
        """Return what the file of channels says, changed by the options."""
        columns, uses = plan.columns, (plan.hammer, plan.specimen)
        if self.columns is not None:
            columns = tuple(role.strip() for role in self.columns.split(","))
            uses = (replace(plan.hammer, channel=""), replace(plan.specimen, channel=""))
        elif self.hammer is not None:
            columns = None
        hammer = _change_use(
            uses[0],
            self.hammer,
            self.hammer_unit,
            self.hammer_sensitivity,
            self.hammer_full_scale,
            (self.hammer_resonance, self.hammer_resonance_damping, self.hammer_low_corner),
        )
        specimen = _change_use(
            uses[1],
            self.specimen,
            self.sample_unit,
            self.sample_sensitivity,
            self.sample_full_scale,
            (self.sample_resonance, self.sample_resonance_damping, self.sample_low_corner),
        )
        rate = plan.sampling_rate if self.rate is None else self.rate
        unit = plan.time_unit if self.time_unit is None else self.time_unit
        return ChannelPlan(hammer, specimen, columns, rate, unit)

    def _read_setup(self, path: Path, file: ImportFile, name: str) -> RigSetup:
        masses = [getattr(source, mass) for source in (self, file) for mass in MASSES]
        given = any(mass is not None and not math.isnan(mass) for mass in masses)
        if given or self.control or file.control:
            raise ParameterError(
                "--rig-file gives the masses and the control sample: leave out --hammer-mass,"
                " --sample-mass, --accelerometer-mass and --control"
            )
        setup = read_rig_file(path).setup
        if not name:
            names = ", ".join(map(repr, setup.samples.names))
            raise ParameterError(f"--rig-file needs --sample, one of {names}")
        setup.samples.find(name)
        return setup

    def _make_setup(self, file: ImportFile, name: str) -> RigSetup:
        """Return the set-up that the masses make, NaN where they are not known."""
        hammer_mass, sample_mass, accelerometer_mass = (
            getattr(file, mass) if getattr(self, mass) is None else getattr(self, mass)
            for mass in MASSES
        )
        control = self.control or file.control
        if control and math.isnan(hammer_mass + sample_mass):
            raise ParameterError("--control needs both masses: --hammer-mass and --sample-mass")
        samples = SampleSet(
            (Sample(name, sample_mass),),
            control_sample=name if control else "",
            accelerometer_mass=0.0 if math.isnan(accelerometer_mass) else accelerometer_mass,
        )
        # Of speed and clock nobody said anything.
        return RigSetup(
            samples, hammer_mass, NAN, description=file.description, clock_uncertainty=0.0
        )


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


def _change_use(
    use: ChannelUse,
    channel: str | None,
    unit: str | None,
    sensitivity: Sensitivity | None,
    full_scale: tuple[float, str] | None,
    response: tuple[float | None, ...],
) -> ChannelUse:
    largest, largest_unit = full_scale or (use.full_scale, use.full_scale_unit)
    known = (use.response.resonance, use.response.damping, use.response.low_corner)
    return ChannelUse(
        use.channel if channel is None else channel,
        use.unit if unit is None else unit,
        sensitivity or use.sensitivity,
        largest,
        largest_unit,
        SensorResponse(
            *(old if new is None else new for old, new in zip(known, response, strict=True))
        ),
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


FINE_POINTS = 100
"""Of a pulse at half amplitude, to see what the low-pass does to it [points], our choice."""
LONG_PULSE = 5.0
"""Width of a pulse over the period of the cutoff from which nothing happens to it [-]."""
WORTH_SAYING = 0.01
"""How much wider a pulse must become [-], our choice."""
USELESS = {Reason.NO_PULSE, Reason.NON_FINITE}
"""Reasons that a file is not a bad hit but no hit at all."""
MASS_OPTIONS = "give --hammer-mass and --sample-mass, or --rig-file"
NAN = math.nan


@dataclass(frozen=True)
class AnalyzedTraces:
    """What the traces say.

    Attributes
    ----------
    results : TraceResults
        Of the files that could be used.
    errors : tuple of str
        One sentence for each file that could not, and for what else went wrong.
    remarks : tuple of str
        What was taken for granted, and what the low-pass does.
    """

    results: TraceResults
    errors: tuple[str, ...]
    remarks: tuple[str, ...]


def analyze_traces(
    paths: Sequence[Path],
    series: TraceSeries,
    accept: Sequence[str] = (),
    reject: Sequence[str] = (),
) -> AnalyzedTraces:
    """Judge every file, select, and estimate from the mean of what is left.

    Parameters
    ----------
    paths : sequence of Path
        A file's place, counted from 1, is the record of its hit.
    series : TraceSeries
        What the files are taken for.
    accept, reject : sequence of str
        Files that a person takes into the mean or leaves out, as given or without their folder.

    Raises
    ------
    ParameterError
        If a person's word on a file makes no sense.
    """
    overrules = _find_overrules(paths, series.sample, accept, reject)
    hits, setup, errors, remarks = read_series(paths, series, needs_scale=False)
    for path, error in errors.items():
        if _make_label(paths.index(path) + 1, series.sample) in overrules.accepted:
            raise ParameterError(f"{path} cannot be accepted by hand: {error}") from None
    for hit in hits:
        if hit.block.label in overrules.accepted:
            _check_acceptable(hit, setup)
    session = Session(setup, overrules)
    judged = [judged for hit in hits for judged in session.feed(hit.block)]
    results, mean_errors = _finish(paths, session, series.sample, judged, hits)
    return AnalyzedTraces(results, (*errors.values(), *mean_errors), remarks)


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
        label = _make_label(number + moved, series.sample)
        analysis, mass = series.setup.analysis, series.setup.hammer_mass
        window = analysis if series.has_window else None
        try:
            found = read_hits(
                path, label, series.plan, mass, needs_scale=needs_scale, window=window
            )
            moved += len(found) - 1
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


def _make_series_setup(series: TraceSeries, hits: Sequence[ImportedHit]) -> RigSetup:
    """Return the set-up of a series, each file a record if nothing else is given."""
    if series.has_window or not hits:
        return series.setup
    return replace(series.setup, analysis=choose_window(series.setup.analysis, hits))


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
    pulses = f"pulses of {width * 1e6:.3g} us at half amplitude"
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


def _check_acceptable(hit: ImportedHit, setup: RigSetup) -> None:
    """Require a pulse that could be measured."""
    for record in ImpactDetector(setup.analysis).feed(hit.block):
        judged = judge_hit(record, setup.analysis)
        if judged.filtered is None:
            why = "; ".join(map(str, judged.rejections))
            raise ParameterError(
                f"{hit.path} cannot be accepted by hand: it has no pulse that could be measured"
                f" ({why})"
            )


def _make_label(number: int, sample: str) -> HitLabel:
    return HitLabel(sample, record=number, impact=number)


def _find_overrules(
    paths: Sequence[Path], sample: str, accept: Sequence[str], reject: Sequence[str]
) -> Overrules:
    """Return the files that a person named as the hits that they hold."""

    def find(option: str, name: str) -> HitLabel:
        found = [
            number for number, path in enumerate(paths, start=1) if name in (str(path), path.name)
        ]
        if len(found) != 1:
            what = "is none of the files" if not found else "may be any of several files"
            raise ParameterError(f"{option} {name!r} {what}: name one as it was given")
        return _make_label(found[0], sample)

    accepted = frozenset(find("--accept", name) for name in accept)
    rejected = frozenset(find("--reject", name) for name in reject)
    for label in accepted & rejected:
        raise ParameterError(
            f"{paths[label.record - 1]} is both accepted and rejected by hand: choose one"
        )
    return Overrules(accepted, rejected)


def _finish(
    paths: Sequence[Path],
    session: Session,
    sample: str,
    judged: Sequence[JudgedHit],
    imported: Sequence[ImportedHit],
) -> tuple[TraceResults, list[str]]:
    errors: list[str] = []
    units = {hit.block.label: hit for hit in imported}
    selection = session.get_selection(sample)
    final = {hit.label: hit for hit in selection.kept + selection.left_out}
    # The last word on a hit comes without its traces.
    hits = tuple(
        replace(
            describe_hit(replace(final[hit.label], filtered=hit.filtered), session.setup),
            measured_peak=hit.hammer_peak / units[hit.label].per_unit,
            measured_unit=units[hit.label].unit,
        )
        for hit in judged
    )
    results = Results(session.setup, HammerEstimate(), (), ())
    if selection.kept:
        try:
            results = results_from_session(session.estimate_all(), {})
        except RigError as error:
            errors.append(f"mean of {len(selection.kept)} hits: {error}")
    elif hits:
        errors.append("no hit was accepted: the contact time is not determined")
    hammer, samples = _name_options(paths, session, sample, results)
    if not all(hit.has_scale for hit in imported):
        # Widths do not depend on the scale: such a channel is good for contact times.
        hits = tuple(replace(hit, hammer_peak=NAN, specimen_peak=NAN) for hit in hits)
        samples = tuple(_drop_scale(item) for item in samples)
    return TraceResults(hammer, samples, hits), errors


def _drop_scale(sample: SampleEstimate) -> SampleEstimate:
    """Return an estimate without what depends on the gain of the hammer's channel."""
    law = sample.contact_law
    kept = ContactLaw(
        exponent=law.exponent,
        duration=law.duration,
        restitution=law.restitution,
        residual_percent=law.residual_percent,
        notes=law.notes,
        is_allowed=law.is_allowed,
        excludes_versed_sine=law.excludes_versed_sine,
    )
    return replace(
        sample,
        hammer_peak=NAN,
        specimen_peak=NAN,
        first_peak=NAN,
        second_peak=NAN,
        peak_force=UNKNOWN,
        contact_law=kept,
    )


def _name_options(
    paths: Sequence[Path], session: Session, sample: str, results: Results
) -> tuple[HammerEstimate, tuple[SampleEstimate, ...]]:
    """Say by which options k1 and the masses come in, and which files are meant by hits."""
    hammer, setup = results.hammer, session.setup
    texts: dict[str, str] = {}
    if math.isnan(setup.hammer_stiffness) and setup.samples.control_sample != sample:
        note = (
            f"k1: {sample!r} is not the control sample; give --hammer-stiffness, or --control if"
            " hammer and sample are alike"
        )
        texts = dict.fromkeys(hammer.notes, note)
        hammer = replace(hammer, control_sample="", notes=(note,))
    if unknown := setup.find_unknown_masses(sample):
        note = f"k and c: the mass of {' and '.join(unknown)} is not known"
        texts[note] = f"{note}; {MASS_OPTIONS}"
    names = {
        f"hit {describe_label(hit.label)} ": f"{paths[hit.label.record - 1].name} "
        for hit in session.get_selection(sample).kept
    }
    samples = []
    for item in results.samples:
        warnings, notes = item.warnings, tuple(texts.get(note, note) for note in item.notes)
        for label, name in names.items():
            warnings = tuple(text.replace(label, name) for text in warnings)
        samples.append(replace(item, warnings=warnings, notes=notes))
    return hammer, tuple(samples)
