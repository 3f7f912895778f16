"""A document as one HTML file that needs no other file."""

from functools import cache
from typing import TYPE_CHECKING

from impact_rig import __version__
from impact_rig.present.report.document import Document, Section

if TYPE_CHECKING:
    import jinja2

PAGE = "page.html.jinja"


def render_page(document: Document) -> str:
    """Return the HTML of a document.

    Everything in it is escaped. The same document gives the same characters.
    """
    numbers: dict[int, int] = {}

    def anchor(section: Section) -> str:
        """Return the id of a section's heading."""
        return f"section-{numbers.setdefault(id(section), len(numbers) + 1)}"

    template = _make_environment().get_template(PAGE)
    return template.render(document=document, anchor=anchor, version=__version__).lstrip()


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
    return environment
