"""README and the documentation as their tests look at them: sections, tables, and blocks that are run."""

from __future__ import annotations

import re
from pathlib import Path

from tests.documentation.reference import BUILT, DOCS, pages, rewritten
from tests.surroundings import ROOT

#: a session at a shell, which is run
CONSOLE = re.compile(r"^```console\n(.*?)^```$", re.M | re.S)
PAGES = [page.relative_to(ROOT).as_posix() for page in pages()]


def text(page: str) -> str:
    """A page by its path from the root: `docs/tutorial.md`."""
    return (ROOT / page).read_text("utf-8")


def built(page: str) -> str:
    """A page of `docs/reference/` that is not kept, as it is built now."""
    return rewritten(BUILT[DOCS / "reference" / page].read_text("utf-8"))


def section(page: str, title: str) -> str:
    """A section of a page, its subsections included."""
    whole = text(page)
    head = re.search(rf"^(#+) {re.escape(title)}$", whole, re.M)
    assert head is not None, f"{page}: {title}"
    rest = whole[head.end() :]
    following = re.search(rf"^#{{1,{len(head[1])}}} ", rest, re.M)
    return rest[: following.start()] if following else rest


def first_column(table: str) -> list[str]:
    """The cells of a table's first column that are code, back-quotes kept."""
    return [line.split("|")[1].strip() for line in table.splitlines() if re.match(r"\| \[?`", line)]


def links(page: str) -> list[tuple[Path, str]]:
    """The files that a page links to, each with its anchor."""
    return links_of(text(page), ROOT / page)


def links_of(written: str, here: Path) -> list[tuple[Path, str]]:
    """The files that the text *written* in the page *here* links to, each with its anchor."""
    outside_code = re.sub(r"^```.*?^```$|`[^`\n]*`", "", written, flags=re.M | re.S)
    found = re.findall(r"\]\(([^)#\s]*)(?:#([^)\s]*))?\)", outside_code)
    return [((here.parent / path).resolve() if path else here, anchor) for path, anchor in found if "://" not in path]


def anchors(page: Path) -> set[str]:
    """The anchors that a page's headings have."""
    heads = re.findall(r"^#+ (.+)$", page.read_text("utf-8"), re.M)
    return {re.sub(r"[^\w -]", "", head).strip().lower().replace(" ", "-") for head in heads}


__all__ = [
    "BUILT",
    "CONSOLE",
    "DOCS",
    "PAGES",
    "anchors",
    "built",
    "first_column",
    "links",
    "links_of",
    "section",
    "text",
]
