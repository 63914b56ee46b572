"""Golden screens of a terminal as pictures (SVG) for README and the documentation, in `docs/screens/`."""

from __future__ import annotations

import re
from pathlib import Path
from xml.sax.saxutils import escape

from dvtcli import __version__
from tests.surroundings import ROOT

PICTURES = ROOT / "docs" / "screens"
#: a picture in a page: the golden screen's file under tests/, and the path of its picture
PICTURED = re.compile(r"^<!-- screen: (\S+) -->\n!\[[^\]]+\]\((\S+)\)$", re.M)
_COLUMN, _ROW, _MARGIN = 8.4, 20, 16


def screen(name: str) -> list[str]:
    """The rows of a golden screen without its empty rows, with this version."""
    rows = (ROOT / "tests" / name).read_text("utf-8").strip("\n").splitlines()
    return [row.rstrip().replace("dvtcli 0.0.0", f"dvtcli {__version__}") for row in rows if row.strip()]


def picture(name: str) -> str:
    """The SVG of a golden screen, which has the same width on every machine."""
    rows = screen(name)
    width = _COLUMN * max(map(len, rows)) + 2 * _MARGIN
    height = _ROW * len(rows) + 2 * _MARGIN
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height}" width="{width:.0f}">',
        f'<rect width="{width:.0f}" height="{height}" rx="8" fill="#1e2329"/>',
        '<g font-family="ui-monospace, Menlo, Consolas, DejaVu Sans Mono, monospace" font-size="14" fill="#e6e6e6">',
    ]
    for number, row in enumerate(rows):
        begin = len(row) - len(row.lstrip())
        x, y = _MARGIN + _COLUMN * begin, _MARGIN + _ROW * number + 15
        long = f'{_COLUMN * (len(row) - begin):.1f}" lengthAdjust="spacingAndGlyphs'
        lines.append(f'<text x="{x:.1f}" y="{y}" xml:space="preserve" textLength="{long}">{escape(row.strip())}</text>')
    return "\n".join([*lines, "</g>", "</svg>", ""])


def pictured(pages: list[Path]) -> dict[Path, str]:
    """The SVG files that *pages* show, each with its golden screen's file under tests/."""
    return {
        (page.parent / path).resolve(): name
        for page in pages
        for name, path in PICTURED.findall(page.read_text("utf-8"))
    }
