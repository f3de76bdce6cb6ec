"""The printable sheet: what is drawn in the PDF is measured, and found by the detector."""

from __future__ import annotations

import re
import zlib
from pathlib import Path

import numpy as np
import pytest

from foottrack_service.camera.detector import TagDetector
from foottrack_service.camera.dictionaries import load_dictionary
from foottrack_service.camera.sheet import PAPERS_MM, Printed, lay_out, write_sheet

POINT_MM = 25.4 / 72.0
DOTS_PER_MM = 4


def pages_of(path: Path) -> list[tuple[tuple[float, float], str]]:
    """Size in mm and drawing operators of each page."""
    raw = path.read_bytes()
    sizes = [tuple(float(v) * POINT_MM for v in box.split()[2:]) for box in re.findall(rb"/MediaBox \[([^\]]+)\]", raw)]
    streams = [
        zlib.decompress(data) for data in re.findall(rb"FlateDecode[^>]*>>\nstream\n(.*?)\nendstream", raw, re.DOTALL)
    ]
    drawings = [text.decode("latin-1") for text in streams if b" re" in text or b" l\n" in text]
    return list(zip(sizes, drawings, strict=True))  # type: ignore[arg-type]


Shape = tuple[str, float, np.ndarray]


def shapes(drawing: str) -> list[Shape]:
    """("f" filled or "S" stroked, grey, corners (n, 2) mm) in the order of drawing: as much PDF as the sheet uses."""
    grey, stack, numbers, points = 0.0, [], [], []
    drawn: list[Shape] = []
    for word in drawing.split():
        try:
            numbers.append(float(word))
            continue
        except ValueError:
            pass
        if word in ("g", "rg"):
            grey = numbers[-1]
        elif word == "q":
            stack.append(grey)
        elif word == "Q":
            grey = stack.pop()
        elif word in ("m", "l"):
            points = [*(points if word == "l" else []), [numbers[-2] * POINT_MM, numbers[-1] * POINT_MM]]
        elif word in ("f", "S") and points:
            drawn.append((word, grey, np.array(points)))
            points = []
        elif word == "n":
            points = []
        numbers = []
    return drawn


def filled(drawing: str) -> list[tuple[float, float, float, float, float]]:
    """Left, bottom, right, top, mm, and grey of the filled boxes."""
    return [(*p.min(axis=0), *p.max(axis=0), grey) for kind, grey, p in shapes(drawing) if kind == "f" and len(p) == 4]


def printed_picture(size: tuple[float, float], drawing: str) -> np.ndarray:
    """The page as a picture of 4 dots a mm."""
    picture = np.full((round(size[1] * DOTS_PER_MM), round(size[0] * DOTS_PER_MM)), 255, np.uint8)
    for left, bottom, right, top, grey in filled(drawing):
        rows = slice(round((size[1] - top) * DOTS_PER_MM), round((size[1] - bottom) * DOTS_PER_MM))
        picture[rows, round(left * DOTS_PER_MM) : round(right * DOTS_PER_MM)] = round(255 * grey)
    return picture


@pytest.mark.parametrize("name", ["DICT_4X4_50", "GENERATED_3X3_4", "DICT_APRILTAG_36h11"])
def test_what_is_printed_is_found_at_its_exact_size(tmp_path: Path, name: str) -> None:
    dictionary = load_dictionary(name)
    tags = [Printed(0, 60.0), Printed(1, 60.0), Printed(3, 100.0)]
    path = tmp_path / "tags.pdf"
    pages = write_sheet(path, dictionary, name, tags)
    drawn = pages_of(path)
    assert len(drawn) == pages
    found = {}
    for size, drawing in drawn:
        assert size == pytest.approx(PAPERS_MM["a4"], abs=0.01)
        for detection in TagDetector(dictionary, range(4)).search(printed_picture(size, drawing)):
            found[detection.id] = detection.side_px / DOTS_PER_MM
    assert found.keys() == {0, 1, 3}
    assert found[0] == pytest.approx(60.0, abs=0.3) and found[3] == pytest.approx(100.0, abs=0.3)
    squares = [(r - l, t - b) for size, d in drawn for l, b, r, t, g in filled(d) if g == 0.0 and r - l > 20.0]  # noqa: E741
    assert sorted(round(side, 3) for square in squares for side in square) == [60.0] * 4 + [100.0] * 2


def test_the_ruler_is_100_mm_long(tmp_path: Path) -> None:
    path = tmp_path / "tags.pdf"
    write_sheet(path, load_dictionary("DICT_4X4_50"), "DICT_4X4_50", [Printed(0, 60.0)])
    ((_, drawing),) = pages_of(path)
    lines = [p for kind, _, p in shapes(drawing) if kind == "S" and len(p) == 2]
    extents = np.array([np.ptp(line, axis=0) for line in lines])
    assert extents[:, 0].max() == pytest.approx(100.0, abs=0.01)
    ticks = [line[0, 0] for line, (wide, high) in zip(lines, extents, strict=True) if wide == 0.0 and high < 6.0]
    steps = np.diff(np.unique(np.round(ticks, 2)))
    assert np.sum(np.isclose(steps, 1.0, atol=0.02)) >= 90


def test_tags_never_overlap_and_fill_pages() -> None:
    placed = lay_out([Printed(i, 70.0) for i in range(9)], 6)
    assert placed[-1].page >= 1
    for i, a in enumerate(placed):
        for b in placed[:i]:
            margin = 2 * 70.0 / 6 - 1e-9
            assert a.page != b.page or abs(a.x - b.x) >= 70.0 + margin or abs(a.y - b.y) >= 70.0 + margin


def test_the_same_sheet_is_the_same_file(tmp_path: Path) -> None:
    for name in ("a.pdf", "b.pdf"):
        write_sheet(tmp_path / name, load_dictionary("DICT_4X4_50"), "x", [Printed(0, 60.0)])
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()


@pytest.mark.parametrize(
    ("tags", "paper"),
    [
        ([], "a4"),
        ([Printed(0, 400.0)], "a4"),
        ([Printed(0, 0.0)], "a4"),
        ([Printed(50, 60.0)], "a4"),
        ([Printed(0, 60.0)], "a9"),
    ],
)
def test_what_cannot_be_printed_is_refused(tmp_path: Path, tags: list[Printed], paper: str) -> None:
    with pytest.raises(ValueError):
        write_sheet(tmp_path / "no.pdf", load_dictionary("DICT_4X4_50"), "x", tags, paper)
