"""What a formal report says beside the numbers, in a person's words, and what it lacks."""

import datetime as dt
import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Self

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.errors import ParameterError


@dataclass(frozen=True)
class Entry:
    """One thing to say, a key in a table of the rig file."""

    key: str
    label: str  # in the report
    clause: str = ""  # of ISO/IEC 17025:2017, which asks for it; empty: only where it applies


LABORATORY = (
    Entry("name", "Laboratory", "7.8.2.1 b"),
    Entry("address", "Address", "7.8.2.1 b"),
    Entry("place", "Place of the tests", "7.8.2.1 c"),
)
REPORT = (
    Entry("number", "Report number", "7.8.2.1 d"),
    Entry("replaces", "Replaces report"),
    Entry("changes", "Changed, and why"),
    Entry("customer", "Customer", "7.8.2.1 e"),
    Entry("condition", "Condition of the items", "7.8.2.1 g"),
    Entry("received", "Items received", "7.8.2.1 h"),
    Entry("sampling", "Sampling"),
    Entry("temperature", "Temperature", "7.8.3.1 a"),
    Entry("humidity", "Relative humidity", "7.8.3.1 a"),
    Entry("deviations", "Deviations from the method", "7.8.2.1 n"),
    Entry("external", "Results of others"),
    Entry("operator", "Tested by"),
    Entry("authorised_by", "Authorised by", "7.8.2.1 o"),
    Entry("issued", "Date of issue", "7.8.2.1 j"),
)
INSTRUMENT = (
    Entry("maker", "Maker"),
    Entry("model", "Model", "6.4.13 b"),
    Entry("serial_number", "Serial number", "6.4.13 b"),
    Entry("certificate", "Certificate", "6.5.1"),
    Entry("calibration_date", "Calibration date", "6.5.1"),
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
INSTRUMENT_KEYS = tuple(entry.key for entry in INSTRUMENT)
MEASURANDS = {
    "contact_time": ("s", "203.2 us"),
    "stiffness": ("N/m", "45.29 MN/m"),
    "damping_coefficient": ("N*s/m", "1170 N*s/m"),
}
"""Of a sample that values and limits are stated for: unit, and an example."""
LIMITS = tuple(f"{bound}_{name}" for name in MEASURANDS for bound in ("minimum", "maximum"))
SAMPLE_KEYS = (*(entry.key for entry in SAMPLE), *LIMITS)
"""Keys of a sample that only a report needs."""


@dataclass(frozen=True)
class Item:
    """What is stated of one sample."""

    texts: Mapping[str, str] = field(default_factory=dict)  # by the keys of `SAMPLE`
    # Of tau_p, k and c by the names of `MEASURANDS` [SI units]; infinite: there is no such limit.
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)


UNSTATED = Item()


@dataclass(frozen=True)
class Particulars:
    """What is stated; what is empty is absent."""

    texts: Mapping[str, Mapping[str, str]] = field(default_factory=dict)  # by table and key
    items: Mapping[str, Item] = field(default_factory=dict)  # by the name of the sample

    def get(self, table: str, key: str) -> str:
        """Return one text; empty: it is not stated."""
        return self.texts.get(table, {}).get(key, "")

    def find_item(self, body: str) -> Item:
        """Return what is stated of a sample, whatever its release angle."""
        return self.items.get(body, UNSTATED)

    def list_facts(self, table: str) -> list[tuple[str, str]]:
        """Return labels and texts of a table."""
        texts = self.texts.get(table, {})
        return [(entry.label, texts[entry.key]) for entry in TABLES[table] if entry.key in texts]

    def set(self, assignments: Iterable[str]) -> Self:
        """Return them with texts in place of others.

        Parameters
        ----------
        assignments : iterable of str
            As ``report.number=4711``; an empty text takes one away.

        Raises
        ------
        ParameterError
            If one is no assignment, or there is no such key.
        """
        texts = {table: dict(found) for table, found in self.texts.items()}
        known = [f"{table}.{entry.key}" for table, entries in TABLES.items() for entry in entries]
        for assignment in assignments:
            name, is_assigned, text = assignment.partition("=")
            if not is_assigned or name.strip() not in known:
                near = difflib.get_close_matches(name, known, n=1)
                hint = near[0] if near else "report.number"
                raise ParameterError(
                    f"{assignment!r} sets nothing: write it like {hint}=TEXT, with one of"
                    f" {', '.join(known)}"
                )
            table, _, key = name.strip().rpartition(".")
            texts.setdefault(table, {})[key] = text.strip()
            if not text.strip():
                del texts[table][key]
        return replace(self, texts=texts)

    def list_lacking(self, samples: Iterable[str]) -> list[str]:
        """Return what ISO/IEC 17025 asks for and nobody has stated, with where to state it."""
        lacking = [
            f"{entry.label}{f' of the {INSTRUMENTS[table]}' if table in INSTRUMENTS else ''}"
            f" ({entry.clause}): {entry.key} in [{table}]"
            for table, entries in TABLES.items()
            for entry in entries
            if entry.clause and not self.get(table, entry.key)
        ]
        if self.get("report", "replaces") and not self.get("report", "changes"):
            lacking.append("Changed, and why (7.8.8.2): changes in [report]")
        named = list(samples)
        for entry in SAMPLE:
            without = [name for name in named if entry.key not in self.find_item(name).texts]
            if without:
                of = "all samples" if without == named else ", ".join(without)
                lacking.append(
                    f"{entry.label} of {of} ({entry.clause}): {entry.key} in [[sample]]"
                )
        return lacking


NOTHING_STATED = Particulars()


def parse_particulars(document: TomlTable) -> Particulars:
    """Return what a rig file states for reports.

    Raises
    ------
    ParameterError
        If a key is unknown where only these are known, or a value is no text or no limit.
    """
    texts = {}
    for name, entries in TABLES.items():
        table = document
        for part in name.split("."):
            table = table.take_table(part)
        if entries is not INSTRUMENT or name == "balance":
            table.check_keys(*(entry.key for entry in entries))
        texts[name] = _take_texts(table, entries)
    items = {
        str(table.get("name")): Item(_take_texts(table, SAMPLE), _take_limits(table))
        for table in document.take_tables("sample")
    }
    return Particulars(texts, items)


def _take_texts(table: TomlTable, entries: Iterable[Entry]) -> dict[str, str]:
    texts = {}
    for entry in entries:
        value = table.get(entry.key)
        if isinstance(value, dt.date):
            texts[entry.key] = value.isoformat()
        elif text := table.take_text(entry.key).strip():
            texts[entry.key] = text
    return texts


def _take_limits(table: TomlTable) -> dict[str, tuple[float, float]]:
    limits = {}
    for name, (unit, example) in MEASURANDS.items():
        low, high = (
            table.take_quantity(f"{bound}_{name}", unit, example, default, low=0.0)
            for bound, default in (("minimum", -math.inf), ("maximum", math.inf))
        )
        if low >= high:
            raise table.refuse(f"minimum_{name}", f"below maximum_{name}")
        if math.isfinite(low) or math.isfinite(high):
            limits[name] = low, high
    return limits
