"""What a formal report says beside the numbers, in a person's words, and what it lacks."""

import difflib
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

from impact_rig.configuration.toml_table import REQUIRED, TomlTable, parse_toml_table
from impact_rig.core.given.errors import ParameterError, check_name


@dataclass(frozen=True)
class Entry:
    """One thing to say, a key in a table of the rig file."""

    key: str
    label: str  # in the report
    clause: str = ""  # of ISO/IEC 17025:2017, which asks for it; empty: only where it applies
    is_date: bool = False


LABORATORY = (
    Entry("name", "Laboratory", "7.8.2.1 b"),
    Entry("address", "Address", "7.8.2.1 b"),
    Entry("place", "Place of the tests", "7.8.2.1 c"),
    Entry("country", "Country"),
)
REPORT = (
    Entry("number", "Report number", "7.8.2.1 d"),
    Entry("replaces", "Replaces report"),
    Entry("changes", "Changed, and why"),
    Entry("customer", "Customer", "7.8.2.1 e"),
    Entry("tested", "Date of the tests", is_date=True),
    Entry("condition", "Condition of the items", "7.8.2.1 g"),
    Entry("received", "Items received", "7.8.2.1 h", is_date=True),
    Entry("sampling", "Sampling"),
    Entry("from_customer", "Stated by the customer"),
    Entry("temperature", "Temperature", "7.8.3.1 a"),
    Entry("humidity", "Relative humidity", "7.8.3.1 a"),
    Entry("method", "Method", "7.8.2.1 f"),
    Entry("reference", "Reference of the method"),
    Entry("validated", "Method validated by", "7.2.2.1"),
    Entry("traceability", "Traceability"),
    Entry("deviations", "Deviations from the method", "7.8.2.1 n"),
    Entry("specification", "Specification"),
    Entry("external", "Results of others"),
    Entry("further", "Further information"),
    Entry("operator", "Tested by"),
    Entry("authorised_by", "Authorised by", "7.8.2.1 o"),
    Entry("opinions_by", "Opinions authorised by"),
    Entry("issued", "Date of issue", "7.8.2.1 j", is_date=True),
)
INSTRUMENT = (
    Entry("maker", "Maker"),
    Entry("model", "Model", "6.4.13 b"),
    Entry("serial_number", "Serial number", "6.4.13 b"),
    Entry("certificate", "Certificate", "6.5.1"),
    Entry("calibration_date", "Calibration date", "6.5.1", is_date=True),
    Entry("calibration_due", "Calibration due", is_date=True),
)
INSTRUMENTS = {
    "source.hammer": "hammer sensor",
    "source.specimen": "sample sensor",
    "digitizer": "digitizer",
    "balance": "balance",
}
"""Tables of the rig file, and what they are called in the report."""
TABLES: Mapping[str, tuple[Entry, ...]] = {
    "laboratory": LABORATORY,
    "report": REPORT,
    **dict.fromkeys(INSTRUMENTS, INSTRUMENT),
}
SAMPLE = (
    Entry("serial_number", "Serial or batch", "7.8.2.1 g"),
    Entry("dimensions", "Dimensions", "7.8.2.1 g"),
)
OF_SAMPLE = "sample."
"""Stands before the name of a sample where `TABLES` have the name of a table."""
INSTRUMENT_KEYS = tuple(entry.key for entry in INSTRUMENT)
MEASURANDS = {
    "contact_time": ("s", "203.2 us"),
    "stiffness": ("N/m", "45.29 MN/m"),
    "damping_coefficient": ("N*s/m", "1170 N*s/m"),
}
"""Quantities of a sample with stated values and limits: unit, and an example."""
LIMIT_KEYS = [f"{bound}_{name}" for bound in ("minimum", "maximum") for name in MEASURANDS]
NO_LIMITS = -math.inf, math.inf
SAMPLE_KEYS = (
    "name", "material", "mass", "mass_uncertainty", *(entry.key for entry in SAMPLE),
    *(f"reference_{name}" for name in MEASURANDS), *LIMIT_KEYS,
)  # fmt: skip
FILE_KEYS = (
    "name", "description", "hammer", "digitizer", "analysis", "samples", "sample", "check_mass",
    "source", "holder", "laboratory", "report", "balance",
)  # fmt: skip
"""Keys of a rig file."""


@dataclass(frozen=True)
class Particulars:
    """What is stated; what is empty is absent."""

    texts: Mapping[str, Mapping[str, str]] = field(default_factory=dict)  # by table and key
    # Least and largest value by sample and `MEASURANDS` [SI units]; infinite: there is no limit.
    limits: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)
    # What else the file says, by dotted key: a report takes that from the recording.
    unused: Mapping[str, object] = field(default_factory=dict)

    def get(self, table: str, key: str) -> str:
        """Return one text; empty: it is not stated."""
        return self.texts.get(table, {}).get(key, "")

    @property
    def samples(self) -> list[str]:
        """Names of the samples of which something is stated."""
        described = (table for table, texts in self.texts.items() if texts)
        names = [name.removeprefix(OF_SAMPLE) for name in described if name.startswith(OF_SAMPLE)]
        return [*dict.fromkeys([*names, *self.limits])]

    def list_facts(self, table: str) -> list[tuple[str, str]]:
        """Return labels and texts of a table."""
        texts = self.texts.get(table, {})
        return [(entry.label, texts[entry.key]) for entry in TABLES[table] if entry.key in texts]

    def put_over(self, other: "Particulars") -> "Particulars":
        """Return them with those of another one where they state nothing.

        An instrument is described by one of them: what is known of another one is not true of it.
        """
        texts = dict(other.texts)
        for table, own in self.texts.items():
            texts[table] = own if own and table in INSTRUMENTS else {**texts.get(table, {}), **own}
        return Particulars(texts, {**other.limits, **self.limits}, other.unused)

    def set(self, assignments: Iterable[str], samples: Collection[str] | None = None) -> Self:
        """Return them with texts and limits in place of others.

        Parameters
        ----------
        assignments : iterable of str
            As ``report.number=4711`` or ``sample.steel small.serial_number=7``; an empty text
            takes one away.
        samples : collection of str, optional
            Those that there are.

        Raises
        ------
        ParameterError
            If one is no assignment, there is no such key or sample, or it wants a date or limit.
        """
        texts = {table: dict(found) for table, found in self.texts.items()}
        known = [f"{table}.{entry.key}" for table, entries in TABLES.items() for entry in entries]
        known += [f"{OF_SAMPLE}NAME.{entry.key}" for entry in SAMPLE]
        known += [f"{OF_SAMPLE}NAME.{key}" for key in LIMIT_KEYS]
        bounds: dict[str, dict[str, str]] = {}
        for assignment in assignments:
            name, _, text = assignment.partition("=")
            table, _, key = name.strip().rpartition(".")
            is_of_sample = table.startswith(OF_SAMPLE)
            if is_of_sample and samples is not None:
                check_name("sample", table.removeprefix(OF_SAMPLE), samples)
            if is_of_sample and key in LIMIT_KEYS and "=" in assignment:
                bounds.setdefault(table.removeprefix(OF_SAMPLE), {})[key] = text.strip()
                continue
            entries = SAMPLE if is_of_sample else TABLES.get(table, ())
            entry = next((entry for entry in entries if entry.key == key), None)
            if entry is None or "=" not in assignment:
                (hint,) = difflib.get_close_matches(name, known, n=1, cutoff=0.0)
                raise ParameterError(
                    f"{assignment!r} sets nothing: write it like {hint}=TEXT; impact-rig up"
                    " --template has all keys"
                )
            found = texts.setdefault(table, {})
            found.pop(key, None)
            found |= _take_texts(TomlTable({key: text.strip()}, f"[{table}]"), [entry])
        changed = {
            name: _take_limits(TomlTable(found, f"sample {name!r}"), self.limits.get(name, {}))
            for name, found in bounds.items()
        }
        return type(self)(texts, {**self.limits, **changed}, self.unused)

    def list_lacking(
        self, samples: Sequence[str], *, is_dated: bool, has_opinions: bool = False
    ) -> list[str]:
        """Return what ISO/IEC 17025 asks for and is not stated, with where to state it.

        Parameters
        ----------
        samples : sequence of str
            Names of those that were tested.
        is_dated : bool
            Whether the recording says when.
        has_opinions : bool
            Whether the report interprets results.
        """
        lacking = [
            f"{entry.label}{f' of the {INSTRUMENTS[table]}' if table in INSTRUMENTS else ''}"
            f" ({entry.clause}): {entry.key} in [{table}]"
            for table, entries in TABLES.items()
            for entry in entries
            if entry.clause and not self.get(table, entry.key)
        ]
        if not (is_dated or self.get("report", "tested")):
            lacking.append("Date of the tests (7.8.2.1 i): tested in [report]")
        if self.get("report", "replaces") and not self.get("report", "changes"):
            lacking.append("Changed, and why (7.8.8.2): changes in [report]")
        if has_opinions and not self.get("report", "opinions_by"):
            lacking.append("Opinions authorised by (7.8.7.1): opinions_by in [report]")
        if any(self.limits.values()) and not self.get("report", "specification"):
            lacking.append(
                "Specification, what sets the limits (7.8.6.2 b): specification in [report]"
            )
        for entry in SAMPLE:
            without = [name for name in samples if not self.get(OF_SAMPLE + name, entry.key)]
            if without:
                of = "all samples" if without == list(samples) else ", ".join(without)
                lacking.append(
                    f"{entry.label} of {of} ({entry.clause}): {entry.key} in [[sample]]"
                )
        return lacking

    def list_contradictions(self, first: str, last: str, today: str) -> list[str]:
        """Return what cannot be true of tests between two days, year-month-day or empty."""
        received, tested, issued = (
            self.get("report", key) for key in ("received", "tested", "issued")
        )
        told = []
        if first and tested and not first <= tested <= last:
            told.append(f"the tests are dated {tested}, and the recording {first}")
        first, last = first or tested, last or tested
        # Days written year-month-day sort as texts.
        if first and received > first:
            told.append(f"the items were received on {received}, after the tests began on {first}")
        if issued and issued < last:
            told.append(f"the report was issued on {issued}, before the tests ended on {last}")
        elif issued and issued < received:
            told.append(f"the report was issued on {issued}, before the items came on {received}")
        elif issued > today:
            told.append(f"the report is issued on {issued}, and today is {today}")
        return told

    def check_replacement(self) -> None:
        """Refuse a report that replaces itself, or another one without saying what changed."""
        number, replaced = (self.get("report", key) for key in ("number", "replaces"))
        if replaced and number == replaced:
            raise ParameterError(
                f"the report {number} replaces itself: it needs a number of its own"
            )
        if replaced and not self.get("report", "changes"):
            raise ParameterError(
                f"the report replaces {replaced} and does not say what changed, and why (7.8.8.2):"
                " state changes in [report]"
            )


NOTHING_STATED = Particulars()


def read_particulars(text: str) -> Particulars:
    """Read a rig file, or one with nothing but what is for reports; errors as below."""
    return parse_particulars(parse_toml_table(text))


def parse_particulars(document: TomlTable) -> Particulars:
    """Return what a rig file states for reports.

    Raises
    ------
    ParameterError
        If a key is unknown where only these are known, or a value is no text, date or limit.
    """
    document.check_keys(*FILE_KEYS)
    texts, limits = {}, {}
    for name, entries in TABLES.items():
        table = document
        for part in name.split("."):
            table = table.take_table(part)
        if entries is not INSTRUMENT or name == "balance":
            table.check_keys(*(entry.key for entry in entries))
        texts[name] = _take_texts(table, entries)
    for table in document.take_tables("sample"):
        table.check_keys(*SAMPLE_KEYS)
        name = table.take_text("name", REQUIRED, "steel small")
        texts[OF_SAMPLE + name] = _take_texts(table, SAMPLE)
        limits[name] = _take_limits(table)
    limits = {name: found for name, found in limits.items() if found}
    return Particulars(texts, limits, dict(_list_unused(document)))


def _list_unused(values: Mapping[str, Any], table: str = "") -> Iterator[tuple[str, object]]:
    """Return the values that a report does not take from a rig file, with their dotted keys."""
    entries = SAMPLE if table.startswith(OF_SAMPLE) else TABLES.get(table, ())
    used = {entry.key for entry in entries}
    if table.startswith(OF_SAMPLE):
        used |= {"name", *LIMIT_KEYS}
    for key, value in values.items():
        name = f"{table}.{key}" if table else key
        if isinstance(value, Mapping):
            yield from _list_unused(value, name)
        elif name == "sample":
            for sample in value:
                yield from _list_unused(sample, OF_SAMPLE + sample["name"])
        elif key not in used:
            yield name, value


def _take_texts(table: TomlTable, entries: Iterable[Entry]) -> dict[str, str]:
    texts = {
        entry.key: (table.take_date if entry.is_date else table.take_text)(entry.key)
        for entry in entries
    }
    return {key: text.strip() for key, text in texts.items() if text.strip()}


def _take_limits(
    table: TomlTable, stated: Mapping[str, tuple[float, float]] | None = None
) -> dict[str, tuple[float, float]]:
    """Return the limits in a table, with those stated before it; an empty text takes one away."""
    limits = {}
    for name, (unit, example) in MEASURANDS.items():
        keys, ends = (f"minimum_{name}", f"maximum_{name}"), (stated or {}).get(name, NO_LIMITS)
        low, high = (
            none
            if table.get(key) == ""
            else table.take_quantity(key, unit, example, before, low=0.0)
            for key, before, none in zip(keys, ends, NO_LIMITS, strict=True)
        )
        if low >= high:
            wanted = f"below {keys[1]}" if keys[0] in table else f"above {keys[0]}"
            raise table.refuse(keys[keys[0] not in table], wanted)
        if (low, high) != NO_LIMITS:
            limits[name] = low, high
    return limits
