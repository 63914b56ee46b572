"""What a way to break a law is, and the words in which they are written."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Break:
    """*text* put behind the imports of *file*, or a new file; the check *law* must name that file."""

    law: str
    file: str
    text: str


def in_a_function(*lines: str) -> str:
    """A function of these *lines*."""
    return "\n".join(["def _broken(node, session, bus, ctx):", *(f"    {line}" for line in lines)])


def for_types(line: str) -> str:
    """*line* where only a type checker looks at it."""
    return f"if TYPE_CHECKING:\n    {line}"
