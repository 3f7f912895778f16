"""Remarks with their subjects; origin of numbers; hits and files one by one."""

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import Any

from impact_rig.core.estimates.paper_method import HammerEstimate
from impact_rig.core.estimates.ringing import BY_FREE_DECAY
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.estimates.uncertainty import LEAST_HITS
from impact_rig.core.given.findings import Note, Reason, Subject
from impact_rig.core.given.records import (
    MIXED,
    SIMULATED,
    UNKNOWN_KIND,
    HitLabel,
    Origin,
    join_origins,
)
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.overrules import Overrule
from impact_rig.core.hit.pulses import PULSE_NAME
from impact_rig.results.campaign import FileResults, HitResults, Results
from impact_rig.results.numbers import MISSING, format_number, format_time, show_unit
from impact_rig.results.references import SCATTER_HITS, PlantTruth, find_plant
from impact_rig.results.table import (
    Column,
    Table,
    list_table,
    make_optional,
    make_table,
    make_text_column,
    read_column,
    read_optional,
)

EXPLANATIONS = {
    SIMULATED: "No hammer struck.",
    MIXED: "The list of hits says which is which.",
    UNKNOWN_KIND: "Nothing says whether a hammer struck.",
}
"""Explanations in the line, by kind."""


def describe_origin(origins: Iterable[Origin]) -> str:
    """Return the line that everything begins with: where the numbers of these hits come from."""
    found = tuple(origins)
    joined = join_origins(found)
    names = [PurePath(name).name for name in dict.fromkeys(item.file for item in found) if name]
    text = f"Origin: {joined}"
    if len(names) > 1:
        text += f" of {len(names)} files: {names[0]} and {len(names) - 1} more"
    elif names:
        text += f": {names[0]}"
    plant = find_plant(joined)
    explanation = plant.description if plant else EXPLANATIONS.get(joined.kind, "")
    return f"{text}.\n{explanation}".rstrip()


@dataclass(frozen=True)
class Remark:
    """One thing that needs attention: the fact and what to do, with its subject."""

    text: str
    about: str = ""  # subject; empty: the whole run
    effect: float = 0.0  # on a result, as a part of it [-]
    is_opinion: bool = False  # it interprets results, and says what to do

    def __str__(self) -> str:
        """Return the text with its subject."""
        return f"{self.about}: {self.text}" if self.about else self.text


NO_RESULT, MISSING_RESULT = math.inf, 1e-3
"""Effect of what leaves a sample without any result, and of what leaves one out [-]: a number that
is not shown is not wrong, so it comes behind what makes a shown one wrong."""
UNSTATED_EFFECT = 0.1
"""Effect of what core warns of without a number [-], our choice: a tenth of k or c."""
FALSE = Reason.SMOOTHED
"""Finding that makes a contact time wrong: as bad as none."""
FEW_NAMES = 3
"""Samples that a remark names one by one [-], our choice."""
FURTHER_METHODS = {
    Subject.CONTACT_LAW, Subject.FREE_DECAY, Subject.MOMENTA,
    Subject.ASSUMED_GAIN, Subject.ASSUMED_MASS, Subject.OPERATIONAL_CHECK,
}  # fmt: skip
"""Methods beside the paper's, and what is assumed."""
ALL_SAMPLES = "all samples"


def _compare_with_law(sample: SampleEstimate) -> float:
    """Return how much k changes by the contact law's duration."""
    law, versed = sample.contact_law, sample.pulse_shape.find_fit(PULSE_NAME)
    if not law.is_known or versed is None:
        return math.nan
    is_contact = law.restitution.value - law.restitution.expanded <= 1.0
    is_better = law.residual_percent < versed.residual_percent
    difference = abs(sample.paper.contact_time.value - law.duration.value)
    if not (is_contact and is_better and difference > law.duration.expanded):
        return math.nan
    return (sample.paper.contact_time.value / law.duration.value) ** 2 - 1.0


def _compare_dampings(sample: SampleEstimate) -> float:
    """Return how much damping by the log decrement exceeds that of the free decay.

    Both come from the same hits: the sum of both ± is more than that of the difference.
    """
    ratio, decay = sample.paper.damping_ratio, sample.free_decay.damping_ratio
    is_beyond = any(line.source == BY_FREE_DECAY for line in ratio.budget)
    return ratio.value / decay.value - 1.0 if is_beyond else math.nan


@dataclass(frozen=True)
class Check:
    """What the numbers of a sample show against the paper's method."""

    compare: Callable[[SampleEstimate], float]  # its effect on a result [-]; NaN: none
    text: str  # with {change} for the effects on all samples


CHECKS = (
    Check(
        _compare_with_law,
        "the pulse is no versed-sine: k_eq by the contact law is {change}; the ± of τp and k hold"
        " what the law says.",
    ),
    Check(
        _compare_dampings,
        "c by the log decrement is {change} than by the free decay, since the contact still drives"
        " the body at its largest peak; the ± of c and ζ reach the free decay.",
    ),
)


def gather_remarks(results: Results, reading: Iterable[str] = ()) -> list[Remark]:
    """Return everything that needs attention, each once, the largest effect on a result first.

    Parameters
    ----------
    reading : iterable of str
        What was found wrong with the file while it was read.
    """
    samples = results.samples
    struck = [sample for sample in samples if sample.impacts_accepted]
    warnings = [(sample.name, note) for sample in samples for note in sample.warnings]
    remarks = [
        *_list_samples_without_hits(results),
        *_list_samples_of_few_hits(struck),
        *_check(struck),
        *_merge([item for item in warnings if item[1].about is FALSE], samples, NO_RESULT),
        *_merge([item for item in warnings if item[1].about is not FALSE], samples),
        *(Remark(text, "file", UNSTATED_EFFECT) for text in dict.fromkeys(reading)),
        *_list_notes(struck, results.hammer, find_plant(results.origin)),
        *_list_rejections(results),
    ]
    return sort_remarks(remarks)


def sort_remarks(remarks: Iterable[Remark]) -> list[Remark]:
    """Return remarks, the largest effect on a result first."""
    return sorted(remarks, key=lambda remark: -remark.effect)


def select_attention(remarks: Sequence[Remark]) -> list[Remark]:
    """Return the remarks that concern a result; the others concern further methods."""
    return [remark for remark in remarks if remark.effect > 0.0]


Common = Collection[Note | Check]
"""Remarks on all samples at once."""


def gather_sample_remarks(sample: SampleEstimate, left_out: Common = ()) -> list[Remark]:
    """Return the remarks on one sample's own numbers, without those on all samples."""
    notes = dict.fromkeys(_list_own(sample))
    struck = [sample] if sample.impacts_accepted else []
    found = _check(struck, left_out) + _list_samples_of_few_hits(struck)
    return [replace(remark, about="") for remark in found] + [
        Remark(str(note)) for note in notes if note not in left_out
    ]


def find_common(results: Results) -> set[Note | Check]:
    """Return the remarks on all samples at once, or with their origin."""
    plant = find_plant(results.origin)
    struck = [sample for sample in results.samples if sample.impacts_accepted]
    notes = [_list_own(sample) for sample in struck]
    common = set.intersection(*map(set, notes)) if notes else set()
    explained = plant.explained if plant is not None else frozenset()
    common |= {note for own in notes for note in own if note.about in explained}
    checks = (it for it in CHECKS if all(map(math.isfinite, map(it.compare, struck))))
    return {*common, *checks}


def _list_own(sample: SampleEstimate) -> list[Note]:
    return [*sample.warnings, *_list_told(sample)]


def _list_told(sample: SampleEstimate) -> list[Note]:
    """Return its notes, each once; what one hit leaves open its table says."""
    is_of_one = sample.impacts_accepted < LEAST_HITS
    notes = dict.fromkeys(sample.notes)
    return [note for note in notes if not (is_of_one and note.about is Subject.UNCERTAINTY)]


def _check(samples: Sequence[SampleEstimate], left_out: Common = ()) -> list[Remark]:
    remarks = []
    for check in CHECKS:
        if check in left_out:
            continue
        effects = {sample.name: check.compare(sample) for sample in samples}
        found = {name: value for name, value in effects.items() if math.isfinite(value)}
        if found:
            about = _name_subjects([*found], len(samples))
            said = check.text.format(change=_span_changes(found.values()))
            most = max(map(abs, found.values()))
            remarks.append(Remark(said, about, most, is_opinion=True))
    return remarks


def _span_changes(parts: Collection[float]) -> str:
    """Return by how many per cent values are higher or lower."""
    sizes = [*map(abs, parts)]
    percents = dict.fromkeys(f"{100.0 * size:.2g}" for size in (min(sizes), max(sizes)))
    signs = dict.fromkeys("lower" if part < 0.0 else "higher" for part in sorted(parts))
    return f"{' to '.join(percents)} % {' or '.join(signs)}"


def _name_subjects(names: Sequence[str], count: int) -> str:
    if len(names) == count > 1:
        return ALL_SAMPLES
    return ", ".join(names) if len(names) <= FEW_NAMES else f"{len(names)} of {count} samples"


def _merge(
    found: Sequence[tuple[str, Note]],
    samples: Sequence[SampleEstimate],
    effect: float = UNSTATED_EFFECT,
) -> list[Remark]:
    """Return notes with the samples that they are about.

    Of a subject of which each sample has one note, they are said once, in the words of the first.
    """
    subjects: dict[Reason | Subject, dict[Note, list[str]]] = {}
    for name, note in found:
        subjects.setdefault(note.about, {}).setdefault(note, []).append(name)
    remarks = []
    for owners in subjects.values():
        names = [name for each in owners.values() for name in each]
        told = {str(note): each for note, each in owners.items()}
        if len(told) > 1 and len(names) == len(set(names)):
            told = {f"{next(iter(told))} ({names[0]}; others alike)": names}
        remarks += [
            Remark(text, _name_subjects(each, len(samples)), effect) for text, each in told.items()
        ]
    return remarks


def _list_notes(
    samples: Sequence[SampleEstimate], hammer: HammerEstimate, plant: PlantTruth | None
) -> list[Remark]:
    """Return why something is not determined: a result, or what a further method says."""
    has_damping = plant is None or plant.has_damping
    needed: list[tuple[str, Note]] = []
    others: list[tuple[str, Note]] = []
    explained = plant.explained if plant is not None else frozenset()
    of_hammer = [note for note in hammer.notes if note.about not in explained]
    for sample in samples:
        is_complete = sample.paper.stiffness.is_known and (
            sample.paper.damping_coefficient.is_known or not has_damping
        )
        for note in _list_told(sample):
            if note.about in explained:
                continue
            if not (is_complete or note.about in FURTHER_METHODS):
                needed.append((sample.name, note))
            elif note not in hammer.notes:
                others.append((sample.name, note))
    told = {note for _, note in needed}
    effect = 0.0 if hammer.stiffness.is_known else MISSING_RESULT
    return [
        *_merge(needed, samples, MISSING_RESULT),
        *(Remark(str(note), "hammer", effect) for note in of_hammer if note not in told),
        *_merge(others, samples, 0.0),
    ]


def _list_samples_without_hits(results: Results) -> list[Remark]:
    names = [sample.name for sample in results.samples if not sample.impacts_accepted]
    if not names:
        return []
    rejected = [hit for hit in results.rejections if hit.sample in names]
    text = f"strike again, no hit was accepted: {count_reasons(rejected)}"
    return [Remark(text, _name_subjects(names, len(results.samples)), NO_RESULT)]


def _list_samples_of_few_hits(struck: Sequence[SampleEstimate]) -> list[Remark]:
    names = [sample.name for sample in struck if sample.impacts_accepted < SCATTER_HITS]
    if not names:
        return []
    text = (
        f"strike {SCATTER_HITS} times or more: how fewer hits scatter is hardly known, so ± may be"
        " too small and decides nothing"
    )
    # It makes no value wrong, so it comes behind what is missing.
    return [Remark(text, _name_subjects(names, len(struck)), 0.1 * MISSING_RESULT)]


def _list_rejections(results: Results) -> list[Remark]:
    """Return how many hits were left out, and why."""
    rejected = results.rejections
    if not rejected:
        return []
    part = len(rejected) / len(results.hits)
    text = f"{len(rejected)} of {len(results.hits)} rejected: {count_reasons(rejected)}"
    # A rejected hit changes no result, and is worth a look all the same.
    return [Remark(text, "hits", 1e-6 * part)]


def count_reasons(hits: Sequence[HitResults]) -> str:
    """Return as text how often each reason was given; a hit may have several."""
    counts = Counter(item.reason.value for hit in hits for item in hit.reasons)
    return ", ".join(f"{reason} ({number})" for reason, number in counts.most_common())


def tabulate_rejections(results: Results) -> list[Table]:
    """Return the rejected hits with their reasons, and what the virtual rig did on purpose."""
    rejected = sorted(results.rejections, key=lambda hit: hit.record)
    hits, more = _list_first(rejected)
    columns = [
        *_make_label_columns(hits),
        _make_hammer_column(hits, results.setup),
        make_text_column("Why", [_list_reasons(hit) for hit in hits]),
        make_text_column("Injected", ["\n".join(hit.injected_faults) for hit in hits]),
        *_make_origin_columns(hits),
    ]
    notes = [*more, f"Hit 3.2: impact 3, attempt 2. Reasons: {count_reasons(rejected)}."]
    if any(hit.injected_faults for hit in hits):
        notes.append("Injected: what the virtual rig did wrong on purpose.")
    return list_table(f"Rejected hits: {len(rejected)}", columns, notes)


MOST_LISTED = 1000
"""Hits that a table lists [-], our choice: thirty pages; a published campaign has 120."""


def _list_first(hits: Sequence[Any]) -> tuple[Sequence[Any], list[str]]:
    """Return the hits that a table lists, and how many more there are."""
    more = len(hits) - MOST_LISTED
    told = [f"The first {MOST_LISTED} hits; {more} more are in results.json."] if more > 0 else []
    return hits[:MOST_LISTED], told


IN_MEAN, LEFT_OUT = "✓", "✗"


def tabulate_marks(results: Results) -> list[Table]:
    """Return every hit as a mark, sample by sample."""
    found: dict[str, list[HitResults]] = {}
    for hit in sorted(results.hits, key=lambda hit: hit.record):
        found.setdefault(hit.sample, []).append(hit)
    accepted = [sum(hit.accepted for hit in hits) for hits in found.values()]
    listed = [_list_first(hits) for hits in found.values()]
    more = dict.fromkeys(text for _, told in listed for text in told)
    columns = [
        make_text_column("Sample", list(found)),
        make_text_column("Hits, as they came", [" ".join(map(_mark, it)) for it, _ in listed]),
        Column("In the mean", list(map(str, accepted))),
        Column(
            "Left out",
            [str(len(hits) - kept) for hits, kept in zip(found.values(), accepted, strict=True)],
        ),
    ]
    note = f"{IN_MEAN}: in the mean; {LEFT_OUT}: left out; in brackets: as a person decided."
    return list_table(f"Hits: {len(results.hits)}", columns, [*more, note])


def _mark(hit: HitResults) -> str:
    mark = IN_MEAN if hit.accepted else LEFT_OUT
    return f"({mark})" if hit.is_by_hand else mark


def tabulate_overrules(
    results: Results, overrules: Sequence[tuple[HitLabel, Overrule]]
) -> list[Table]:
    """Return who decided on hits, why and when."""
    found = {hit.label: (*hit.reasons, *hit.findings) for hit in results.hits}
    said = [
        "\n".join(str(item) for item in found[label] if item.reason is not Reason.OPERATOR)
        for label, _ in overrules
    ]
    columns = [
        make_text_column("Hit", [str(label) for label, _ in overrules]),
        make_text_column("Decision", [item.decision for _, item in overrules]),
        make_text_column("Why", [item.reason or MISSING for _, item in overrules]),
        make_text_column("Who", [item.who or MISSING for _, item in overrules]),
        make_text_column(
            "When",
            [format_time(item.stamp) if item.stamp else MISSING for _, item in overrules],
        ),
        make_text_column("The analysis says", said),
    ]
    count = len({label for label, _ in overrules})
    return list_table(f"Hits on which a person decided: {count}", columns)


def tabulate_accepted(results: Results) -> list[Table]:
    """Return the hits in the means, each as it was by itself."""
    accepted = [hit for hit in results.hits if hit.accepted]
    hits, more = _list_first(accepted)
    columns = [
        *_make_label_columns(hits),
        read_optional("τp [µs]", hits, "contact_time", 2),
        _make_hammer_column(hits, results.setup),
        read_optional("Sample peak [m/s²]", hits, "specimen_peak", 1),
        *_make_origin_columns(hits),
    ]
    note = "τp: of this hit alone. Peaks: largest value after the low-pass, either sign."
    return list_table(f"Hits in the means: {len(accepted)}", columns, [*more, note])


def _make_label_columns(hits: Sequence[HitResults]) -> list[Column]:
    return [
        make_text_column("Sample", [hit.sample for hit in hits]),
        Column("Hit", [f"{hit.impact}.{hit.attempt}" for hit in hits]),
        make_optional("Record", [str(hit.record) for hit in hits]),
    ]


def _make_origin_columns(hits: Sequence[HitResults]) -> list[Column]:
    """Return file and place of imported hits; the kind of each where they are not all of one."""
    origins = [hit.origin for hit in hits]
    is_mixed = len({origin.kind for origin in origins}) > 1
    return [
        make_text_column("Origin", [str(origin) if is_mixed else "" for origin in origins]),
        make_text_column("File", [PurePath(origin.file).name for origin in origins]),
        make_text_column("Place", [origin.place for origin in origins]),
    ]


def _list_reasons(hit: HitResults | FileResults) -> str:
    return "\n".join(map(str, hit.reasons))


def _make_hammer_column(hits: Sequence[HitResults], setup: RigSetup) -> Column:
    factor, unit = setup.hammer_reading
    peaks = [factor * hit.hammer_peak for hit in hits]
    cells = [format_number(peak, 1) for peak in peaks]
    return make_optional(f"Hammer peak [{show_unit(unit)}]", cells)


def tabulate_hits(hits: Sequence[FileResults]) -> Table:
    """Return the findings in every file; rejected ones are marked."""
    hits, more = _list_first(hits)
    unit = hits[0].measured_unit if hits else ""
    base = "Above 1 %: time above a hundredth of the peak."
    left = "leaves: RMS of what the best shape leaves, over the peak."
    peaks = [hit.measured_peak for hit in hits]
    columns = [
        make_text_column("File", _shorten([hit.origin.file for hit in hits])),
        read_column("τp [µs]", hits, "contact_time", 2, note="±: of the one hit, 95 %."),
        make_text_column(
            "Verdict", ["accepted" if hit.accepted else _list_reasons(hit) for hit in hits]
        ),
        read_optional("w50 [µs]", hits, "half_amplitude_width", 2),
        read_optional("Above 1 % [µs]", hits, "base_width", 2, base),
        read_optional("w10/w50", hits, "width_ratio", 3),
        make_optional("Best shape", [hit.best_shape or MISSING for hit in hits], is_text=True),
        read_optional("leaves [%]", hits, "shape_residual_percent", 1, left),
        make_optional(
            f"Peak [{show_unit(unit)}]" if unit else "Peak",
            [f"{peak:.4g}" if math.isfinite(peak) else MISSING for peak in peaks],
        ),
        make_optional("Place", [hit.origin.place for hit in hits], is_text=True),
    ]
    wrong = [place for place, hit in enumerate(hits) if not hit.accepted]
    return make_table("Hits", columns, more, marked=wrong)


def _shorten(files: Sequence[str]) -> Sequence[str]:
    """Return the names without their folders, where these are distinct."""
    names = [PurePath(file).name for file in files]
    return names if len(set(names)) == len(names) else files
