"""Plain traces through the core, all of one sample.

They take the way of a recording, so that their import gives the same numbers.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from impact_rig.analysis.measured_files import TraceSeries, join_errors, read_series
from impact_rig.analysis.recording_analysis import describe_hit
from impact_rig.core.errors import ParameterError, RigError
from impact_rig.core.estimation.contact_law import ContactLaw
from impact_rig.core.estimation.paper_method import HammerEstimate
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.hits.hit import JudgedHit, judge_hit
from impact_rig.core.hits.overrule import Overrules, describe_label
from impact_rig.core.quantity import UNKNOWN
from impact_rig.core.session import Session
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.detection import ImpactDetector
from impact_rig.core.signals.record import HitLabel
from impact_rig.recordings.importing import ImportedHit
from impact_rig.results.campaign import Results, results_from_session
from impact_rig.results.traced_campaign import TracedCampaign

MASS_OPTIONS = "give --hammer-mass and --sample-mass, or --rig-file"
NAN = math.nan


@dataclass(frozen=True)
class AnalyzedTraces:
    """What the traces say.

    Attributes
    ----------
    campaign : TracedCampaign
        Of the files that could be used.
    errors : tuple of str
        One sentence for each file that could not, and for what else went wrong.
    remarks : tuple of str
        What was taken for granted, and what the low-pass does.
    """

    campaign: TracedCampaign
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
    series : TraceSeries
        What the files are taken for.
    accept, reject : sequence of str
        Files whose hits a person takes into the mean or leaves out, as given or without their
        folder.

    Raises
    ------
    ParameterError
        If a person's word on a file makes no sense.
    """
    hits, setup, errors, remarks = read_series(paths, series, needs_scale=False)
    overrules = _find_overrules(paths, hits, errors, accept, reject)
    for hit in hits:
        if hit.block.label in overrules.accepted:
            _check_acceptable(hit, setup)
    session = Session(setup, overrules)
    judged = [judged for hit in hits for judged in session.feed(hit.block)]
    campaign, mean_errors = _finish(session, series.sample, judged, hits)
    return AnalyzedTraces(campaign, (*join_errors(errors), *mean_errors), remarks)


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


def _find_overrules(
    paths: Sequence[Path],
    hits: Sequence[ImportedHit],
    errors: Mapping[Path, str],
    accept: Sequence[str],
    reject: Sequence[str],
) -> Overrules:
    """Return the files that a person named as the hits that they hold."""

    def find(option: str, name: str) -> Path:
        found = [path for path in paths if name in (str(path), path.name)]
        if len(found) != 1:
            what = "is none of the files" if not found else "may be any of several files"
            raise ParameterError(f"{option} {name!r} {what}: name one as it was given")
        return found[0]

    accepted = {find("--accept", name) for name in accept}
    rejected = {find("--reject", name) for name in reject}
    for path in accepted & rejected:
        raise ParameterError(f"{path} is both accepted and rejected by hand: choose one")
    for path in accepted & errors.keys():
        raise ParameterError(f"{path} cannot be accepted by hand: {errors[path]}")

    def list_labels(files: set[Path]) -> frozenset[HitLabel]:
        return frozenset(hit.block.label for hit in hits if hit.path in files)

    return Overrules(list_labels(accepted), list_labels(rejected))


def _finish(
    session: Session,
    sample: str,
    judged: Sequence[JudgedHit],
    imported: Sequence[ImportedHit],
) -> tuple[TracedCampaign, list[str]]:
    errors: list[str] = []
    units = {hit.block.label: hit.unit for hit in imported}
    selection = session.get_selection(sample)
    final = {hit.label: hit for hit in selection.kept + selection.left_out}
    # The last word on a hit comes without its traces.
    hits = tuple(
        replace(
            describe_hit(replace(final[hit.label], filtered=hit.filtered), session.setup),
            measured_unit=units[hit.label],
        )
        for hit in judged
    )
    try:
        results = results_from_session(session.estimate_all(), {})
    except RigError as error:
        errors.append(f"mean of {len(selection.kept)} hits: {error}")
        results = Results(session.setup, HammerEstimate(), (), ())
    if hits and not selection.kept:
        errors.append("no hit was accepted: the contact time is not determined")
    hammer, samples = _name_options(session, sample, results, imported)
    if not all(hit.has_scale for hit in imported):
        # Widths do not depend on the scale: such a channel is good for contact times.
        hits = tuple(replace(hit, hammer_peak=NAN, specimen_peak=NAN) for hit in hits)
        samples = tuple(_drop_scale(item) for item in samples)
    return TracedCampaign(replace(results, hammer=hammer, samples=samples), files=hits), errors


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
    session: Session, sample: str, results: Results, imported: Sequence[ImportedHit]
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
    counts = Counter(hit.path for hit in imported)
    names = {
        f"hit {describe_label(hit.block.label)} ": f"{hit.path.name} "
        for hit in imported
        if counts[hit.path] == 1
    }
    samples = []
    for item in results.samples:
        warnings, notes = item.warnings, tuple(texts.get(note, note) for note in item.notes)
        for label, name in names.items():
            warnings = tuple(text.replace(label, name) for text in warnings)
        samples.append(replace(item, warnings=warnings, notes=notes))
    return hammer, tuple(samples)
