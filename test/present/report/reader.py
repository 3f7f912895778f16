"""An eye that knows nothing of the templates: the page as its elements, tables and words."""

import re
from html.parser import HTMLParser

VOID = {"meta", "link", "br", "img", "hr", "input"}
HEADINGS = ("h1", "h2", "h3", "h4", "h5", "h6")


class Reader(HTMLParser):
    """Gathers elements with their attributes and text, and checks that they are nested."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[tuple[str, str]] = []
        self.tables: list[list[list[str]]] = []
        self.captions: list[str] = []
        self._open: list[str] = []
        self.feed(page)
        self.close()
        assert not self._open

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag in VOID:
            return
        self._open.append(tag)
        if tag == "table":
            self.tables.append([])
            self.captions.append("")
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("th", "td"):
            self.tables[-1][-1].append("")

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        if not self._open:
            assert not data.strip()
            return
        self.texts.append((self._open[-1], data))
        if "caption" in self._open:
            self.captions[-1] += data
        elif {"th", "td"} & set(self._open):
            self.tables[-1][-1][-1] += data

    def find(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]

    def find_table(self, start: str) -> list[list[str]]:
        place = next(i for i, text in enumerate(self.captions) if text.startswith(start))
        return self.tables[place]

    @property
    def text(self) -> str:
        shown = (text for tag, text in self.texts if tag not in ("style", "title"))
        return re.sub(r"\s+", " ", " ".join(shown))
