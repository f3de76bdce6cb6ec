"""A printable sheet of tags: a PDF of exact size with a ruler, since a print at 97 % puts every foot 3 % too far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from foottrack_service.camera.dictionaries import Bits, tag_cells

PAPERS_MM = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}
_BORDER_MM = 15.0
_RULER_MM = 100.0
_RULER_SPACE_MM = 28.0
_LABEL_MM = 8.0
_INCH_MM = 25.4


@dataclass(frozen=True)
class Printed:
    """A tag to print: `size` mm, black edge to black edge."""

    id: int
    size: float


@dataclass(frozen=True)
class Placed:
    """A tag on a page: its black square's lower left corner, mm from the page's."""

    tag: Printed
    page: int
    x: float
    y: float


def lay_out(tags: Sequence[Printed], cells: int, paper: str = "a4") -> list[Placed]:
    """Rows of tags with a white margin of one cell at least (`cells` across, border included), page by page.

    Raises ValueError for an unknown paper, or a tag that does not fit it.
    """
    if paper not in PAPERS_MM:
        raise ValueError(f"paper is {' or '.join(PAPERS_MM)}, not {paper!r}")
    width, height = PAPERS_MM[paper]
    bottom = _BORDER_MM + _RULER_SPACE_MM
    page, x, top, row = 0, _BORDER_MM, height - _BORDER_MM, 0.0
    placed = []
    for tag in tags:
        margin = tag.size / cells
        wide, high = tag.size + 2.0 * margin, tag.size + 2.0 * margin + _LABEL_MM
        if tag.size <= 0.0 or wide > width - 2.0 * _BORDER_MM or high > height - _BORDER_MM - bottom:
            raise ValueError(f"a tag of {tag.size:g} mm does not fit {paper}")
        if x + wide > width - _BORDER_MM:
            x, top, row = _BORDER_MM, top - row, 0.0
        if top - high < bottom:
            page, x, top, row = page + 1, _BORDER_MM, height - _BORDER_MM, 0.0
        placed.append(Placed(tag, page, x + margin, top - margin - tag.size))
        x, row = x + wide, max(row, high)
    return placed


def write_sheet(
    path: Path, dictionary: Any, name: str, tags: Sequence[Printed], paper: str = "a4", title: str = ""
) -> int:
    """Write the PDF and say how many pages it has.

    Raises ValueError (an id the dictionary has not, a tag that does not fit, no tag at all) and OSError.
    """
    if not tags:
        raise ValueError("there is no tag to print")
    patterns = {tag.id: tag_cells(dictionary, tag.id) for tag in tags}
    placed = lay_out(tags, next(iter(patterns.values())).shape[0], paper)
    pages = placed[-1].page + 1
    # Type 42 keeps the text searchable; no date, so that the same sheet is the same file.
    with matplotlib.rc_context({"pdf.fonttype": 42}), PdfPages(path, metadata={"CreationDate": None}) as pdf:
        for page in range(pages):
            figure, axes = _page(paper)
            for place in placed:
                if place.page == page:
                    _draw_tag(axes, place, patterns[place.tag.id], name)
            _draw_ruler(axes, title or f"{name}, page {page + 1} of {pages}")
            pdf.savefig(figure)
    return pages


def _page(paper: str) -> tuple[Figure, Any]:
    width, height = PAPERS_MM[paper]
    figure = Figure(figsize=(width / _INCH_MM, height / _INCH_MM))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0.0, width)
    axes.set_ylim(0.0, height)
    axes.axis("off")
    return figure, axes


def _draw_tag(axes: Any, place: Placed, cells: Bits, name: str) -> None:
    n, size = cells.shape[0], place.tag.size
    cell = size / n
    _box(axes, place.x, place.y, size, size, "black")
    for row in range(n):
        column = 0
        while column < n:
            end = column
            while end < n and cells[row, end]:
                end += 1
            if end > column:
                _box(
                    axes, place.x + column * cell, place.y + (n - 1 - row) * cell, (end - column) * cell, cell, "white"
                )
            column = max(end, column + 1)
    label = f"{name}  id {place.tag.id}  {size:g} mm   top: away from this line"
    axes.text(place.x, place.y - cell - 0.5 * _LABEL_MM, label, fontsize=6, va="center")
    # Where to cut: one cell of white all round belongs to the tag.
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        x, y = place.x - cell + dx * (size + 2 * cell), place.y - cell + dy * (size + 2 * cell)
        axes.plot([x - 1.5, x + 1.5], [y, y], color="0.6", linewidth=0.3)
        axes.plot([x, x], [y - 1.5, y + 1.5], color="0.6", linewidth=0.3)


def _draw_ruler(axes: Any, title: str) -> None:
    left, bottom = _BORDER_MM, _BORDER_MM + 8.0
    axes.plot([left, left + _RULER_MM], [bottom, bottom], color="black", linewidth=0.4)
    for mm in range(int(_RULER_MM) + 1):
        long = 5.0 if mm % 10 == 0 else 3.5 if mm % 5 == 0 else 2.0
        axes.plot([left + mm, left + mm], [bottom, bottom + long], color="black", linewidth=0.25)
        if mm % 10 == 0:
            axes.text(left + mm, bottom + 6.0, str(mm), fontsize=6, ha="center", va="bottom")
    advice = "Print at 100 % (no fitting to the page). This ruler must measure 100 mm; if not, do not use the sheet."
    axes.text(left, bottom - 3.0, advice, fontsize=7, va="center")
    axes.text(left, bottom - 7.0, title, fontsize=7, va="center")


def _box(axes: Any, x: float, y: float, width: float, height: float, colour: str) -> None:
    axes.add_patch(Rectangle((x, y), width, height, facecolor=colour, edgecolor="none", linewidth=0.0))
