"""What tables of samples do not say: remarks with whom they are about, and hits one by one."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import PurePath

from impact_rig.core.estimation.paper_method import HammerEstimate
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.hits.reasons import Reason
from impact_rig.core.origin import MIXED, SIMULATED, UNKNOWN_KIND, Origin, join_origins
from impact_rig.core.setup.samples import RigSetup
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.numbers import format_count, format_number, show_unit
from impact_rig.results.tables import (
    Column,
    Table,
    make_optional,
    make_table,
    make_text_column,
    read_column,
)

SHOWN_FILES = 3
"""How many files the line on the origin names, our choice."""
EXPLANATIONS = {
    SIMULATED: "No hammer struck: agreement with the paper tests the software, not the paper.",
    MIXED: "The list of hits says which is which.",
    UNKNOWN_KIND: "Nothing says whether a hammer struck.",
}
"""What else the line says, by kind."""


def describe_origin(origins: Iterable[Origin]) -> str:
    """Return the line that everything begins with: where the numbers of these hits come from."""
    found = tuple(origins)
    joined = join_origins(found)
    names = [PurePath(name).name for name in dict.fromkeys(item.file for item in found) if name]
    text = f"Origin: {joined}"
    if names:
        more = len(names) - SHOWN_FILES
        shown = ", ".join(names[:SHOWN_FILES]) + (f" and {more} more" if more > 0 else "")
        text += f" of {format_count(len(names), 'file')}: {shown}" if more > 0 else f": {shown}"
    return f"{text}. {EXPLANATIONS.get(joined.kind, '')}".rstrip()


@dataclass(frozen=True)
class Remark:
    """One thing to know, and whom it is about; empty: everything."""

    text: str
    about: str = ""


def gather_warnings(samples: Sequence[SampleEstimate]) -> list[Remark]:
    """Return what a reader of the numbers must know, each once with the samples it is about.

    What differs from sample to sample in its details alone, behind the first colon, is said once,
    with each sample's details.
    """
    remarks = _gather([(sample.name, sample.warnings) for sample in samples])
    stems: dict[str, list[Remark]] = {}
    for remark in remarks:
        stems.setdefault(remark.text.partition(": ")[0], []).append(remark)
    return [_join(stem, alike) for stem, alike in stems.items()]


def _join(stem: str, remarks: Sequence[Remark]) -> Remark:
    if len(remarks) == 1:
        return remarks[0]
    details = [f"{remark.about}: {remark.text.partition(': ')[2]}" for remark in remarks]
    return Remark(f"{stem}: {'; '.join(details)}")


def gather_notes(samples: Sequence[SampleEstimate], hammer: HammerEstimate) -> list[Remark]:
    """Return what could not be determined and why, each once with whom it is about."""
    notes = _gather([(sample.name, sample.notes) for sample in samples])
    return notes + [Remark(note, "hammer") for note in hammer.notes]


def _gather(remarks: Sequence[tuple[str, Iterable[str]]]) -> list[Remark]:
    holders: dict[str, list[str]] = {}
    for name, texts in remarks:
        for text in texts:
            holders.setdefault(text, []).append(name)
    return [
        Remark(text, "all samples" if len(names) == len(remarks) > 1 else ", ".join(names))
        for text, names in holders.items()
    ]


def count_reasons(hits: Sequence[HitResults]) -> str:
    """Return how often each reason was given, in words; a hit may have several."""
    counts = Counter(_read_code(reason) for hit in hits for reason in hit.reasons)
    return ", ".join(f"{reason} ({number})" for reason, number in counts.most_common())


def tabulate_rejections(results: Results) -> list[Table]:
    """Return the rejected hits with their reasons, and what the virtual rig did on purpose.

    Marked are those with which something is wrong, not those that others were preferred to.
    """
    hits = sorted(results.rejections, key=lambda hit: hit.record)
    if not hits:
        return []
    columns = [
        *_make_label_columns(hits),
        _make_hammer_column(hits, results.setup),
        make_text_column("Why", ["\n".join(hit.reasons) for hit in hits]),
        make_text_column("Injected", ["\n".join(hit.injected_faults) for hit in hits]),
        *_make_origin_columns(hits),
    ]
    notes = [f"Hit 3.2: impact 3, attempt 2. Reasons: {count_reasons(hits)}."]
    if any(hit.injected_faults for hit in hits):
        notes.append("Injected: what the virtual rig did wrong on purpose.")
    wrong = [
        place
        for place, hit in enumerate(hits)
        if any(_read_code(reason) != Reason.SURPLUS.value for reason in hit.reasons)
    ]
    return [make_table(f"Rejected hits: {len(hits)}", columns, notes, wrong)]


def tabulate_accepted(results: Results) -> list[Table]:
    """Return the hits in the means, each as it was by itself."""
    hits = [hit for hit in results.hits if hit.accepted]
    if not hits:
        return []
    columns = [
        *_make_label_columns(hits),
        read_column("τp [µs]", hits, "contact_time", 2, is_optional=True),
        _make_hammer_column(hits, results.setup),
        read_column("Sample peak [m/s²]", hits, "specimen_peak", 1, is_optional=True),
        make_text_column("By hand", ["\n".join(hit.reasons) for hit in hits]),
        *_make_origin_columns(hits),
    ]
    note = "τp: of this hit alone. Peaks: largest value after the low-pass, either sign."
    return [make_table(f"Hits in the means: {len(hits)}", columns, [note])]


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


def _make_hammer_column(hits: Sequence[HitResults], setup: RigSetup) -> Column:
    factor, unit = setup.hammer_reading
    peaks = [factor * hit.hammer_peak for hit in hits]
    cells = [format_number(peak, 1) for peak in peaks]
    return make_optional(f"Hammer peak [{show_unit(unit)}]", cells)


def _read_code(reason: str) -> str:
    return reason.partition(":")[0]
