"""An eye that reads a figure as a program that knows nothing of ours."""

import re
from collections.abc import Callable
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from impact_rig.present.figures.markup import ReportFigure

SVG = "{http://www.w3.org/2000/svg}"


class Panel:
    """One ``<svg>`` of a figure, read as it stands."""

    def __init__(self, element: ET.Element, name: str) -> None:
        self.element = element
        self._name = name

    def find(self, part: str) -> ET.Element | None:
        """Return the element that the drawing calls `part`."""
        identifier = f"{self._name}-{part}"
        return next((e for e in self.element.iter() if e.get("id") == identifier), None)

    def list_parts(self, beginning: str) -> list[str]:
        """Return the names of the parts that begin like this."""
        start = f"{self._name}-{beginning}"
        names = [e.get("id", "") for e in self.element.iter()]
        return [name.removeprefix(f"{self._name}-") for name in names if name.startswith(start)]

    def read_points(self, part: str) -> np.ndarray:
        """Return where markers, or the points of a line, are drawn, shape (n, 2)."""
        element = self.find(part)
        assert element is not None, part
        uses = list(element.iter(f"{SVG}use"))
        if uses:
            return np.array([[float(use.get("x")), float(use.get("y"))] for use in uses])
        path = next(element.iter(f"{SVG}path")).get("d")
        numbers = [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", path)]
        return np.array(numbers).reshape(-1, 2)

    def read_styles(self, part: str) -> str:
        """Return the styles of all paths of a part."""
        return " ".join(e.get("style", "") for e in self.find(part).iter(f"{SVG}path"))

    def list_texts(self) -> list[tuple[str, float]]:
        """Return all text with its height in the picture, in the order of the drawing."""
        elements = self.element.iter(f"{SVG}text")
        return [("".join(e.itertext()), float(e.get("y", "0"))) for e in elements]

    def read_texts(self) -> list[str]:
        """Return all text."""
        return [text for text, _ in self.list_texts()]

    def read_bands(self) -> list[list[float]]:
        """Return the horizontal edges of every shaded band of the axes."""
        paths = [
            e for e in self.element.iter(f"{SVG}path") if "opacity:0.13" in e.get("style", "")
        ]
        numbers = [re.findall(r"-?\d+(?:\.\d+)?", path.get("d")) for path in paths]
        return [[min(x), max(x)] for x in ([float(n) for n in row[::2]] for row in numbers)]

    def read_ticks(self, anchor: str, *, above: float = np.inf) -> np.ndarray:
        """Return value and place of the numbers beside an axis, shape (n, 2).

        `anchor` is "middle" for the horizontal axis and "end" for the vertical one, whose
        numbers stand a little below their ticks; `above` leaves out what is further down.
        """
        key = "x" if anchor == "middle" else "y"
        ticks = []
        for element in self.element.iter(f"{SVG}text"):
            text = "".join(element.itertext()).replace("\N{MINUS SIGN}", "-")
            if f"text-anchor:{anchor}" not in element.get("style", ""):
                continue
            if re.fullmatch(r"-?\d+(\.\d+)?", text) and float(element.get("y")) < above:
                ticks.append((float(text), float(element.get(key))))
        return np.array(ticks)

    def measure(self, places: np.ndarray, anchor: str, *, above: float = np.inf) -> np.ndarray:
        """Return the values at places of an axis; on the vertical one they share an offset."""
        values, ticks = self.read_ticks(anchor, above=above).T
        slope, offset = np.polyfit(ticks, values, 1)
        return slope * places + offset


Read = Callable[[ReportFigure], list[Panel]]


@pytest.fixture
def read() -> Read:
    """Return the function that reads the panels of a figure."""

    def read_panels(figure: ReportFigure) -> list[Panel]:
        root = ET.fromstring(figure.svg.replace(": ", ":"))
        return [
            Panel(element, f"{figure.name}-{place}")
            for place, element in enumerate(root.findall(f"{SVG}svg"), start=1)
        ]

    return read_panels
