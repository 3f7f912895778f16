"""The parts of a report, and their page: one HTML file that needs no other file."""

import math
import re
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from impact_rig.present.picture import Picture
from impact_rig.results.remarks import Remark
from impact_rig.results.table import Table
from impact_rig.version import __version__

if TYPE_CHECKING:
    import jinja2


@dataclass(frozen=True)
class Paragraph:
    """Text of one paragraph."""

    text: str


@dataclass(frozen=True)
class Remarks:
    """A list of remarks."""

    items: tuple[Remark, ...]
    is_warning: bool = False


@dataclass(frozen=True)
class Facts:
    """Names and values; those without a value are left out."""

    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Folded:
    """Contents that unfold on a click, and are printed as far as they are unfolded."""

    title: str
    parts: tuple["Part", ...]


Part = Paragraph | Remarks | Facts | Table | Picture | Folded


@dataclass(frozen=True)
class Section:
    """A heading with its parts, and sections one level deeper."""

    title: str
    parts: tuple[Part, ...] = ()
    sections: tuple["Section", ...] = ()
    is_whole: bool = False  # its parts stand beside each other, on one page of paper


@dataclass(frozen=True)
class Document:
    """A whole page."""

    title: str
    subtitle: str
    name: str
    number: str  # of the report, on every page of paper; may be empty
    banner: str
    is_warning: bool
    facts: tuple[tuple[str, str], ...]
    sections: tuple[Section, ...]
    laws: frozenset[str] = frozenset()  # forms of loss in its contact laws, whose sources it names
    signatory: str = ""  # who authorises it
    has_damping: bool = True
    has_models: bool = True  # whether one is held against the traces
    has_expected: bool = True  # whether anything is expected of a sample
    method: tuple[tuple[str, str], ...] = ()  # how it is cited, what the results are
    reference: str = ""  # [1], as it is cited
    annex: tuple[Section, ...] = ()  # behind the signature
    has_annex: bool = True  # also the method in detail
    has_opinions: bool = True


def drop_empty(*sections: Section | None) -> tuple[Section, ...]:
    """Return the sections that are not empty."""
    return tuple(
        section for section in sections if section and (section.parts or section.sections)
    )


PAGE = "page.html.jinja"


def render_page(document: Document) -> str:
    """Return the HTML of a document.

    Everything in it is escaped. The same document gives the same characters.
    """
    numbers: dict[int, int] = {}

    def anchor(section: Section) -> str:
        """Return the id of a section's heading."""
        return f"section-{numbers.setdefault(id(section), len(numbers) + 1)}"

    return (
        get_template(PAGE).render(document=document, anchor=anchor, version=__version__).lstrip()
    )


def get_template(name: str) -> "jinja2.Template":
    """Return a template of reports, which escapes what it is given."""
    return _make_environment().get_template(name)


@cache
def _make_environment() -> "jinja2.Environment":
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("impact_rig.present.report"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["kind"] = lambda part: type(part).__name__
    environment.filters["quote"] = _quote_css
    environment.filters["cite"] = cite
    environment.filters["clean"] = _clean
    environment.tests["finite"] = math.isfinite
    return environment


PAPER = re.compile(r"\b[Tt]he paper's(?: ([\w-]+))?|\b(?:[Tt]he )?[Pp]aper\b(?!')")


def cite(text: str) -> str:
    """Return a text that names the paper by its number among the sources."""
    return PAPER.sub(lambda found: f"the {found[1]} of [1]" if found[1] else "[1]", text)


def _quote_css(text: str) -> str:
    """Return a text as a string of CSS, which nothing in it can end."""
    letters = (item if item.isalnum() else f"\\{ord(item):x} " for item in text)
    return f'"{"".join(letters)}"'


def _clean(text: str) -> str:
    """Return a text with single blanks, without letters that XML does not allow."""
    return re.sub(r"[^\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "", " ".join(text.split()))
