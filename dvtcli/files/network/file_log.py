"""Collect complaints and notes while a network file is read."""

from __future__ import annotations

from collections.abc import Iterable

from dvtcli.domain.network.network_config import FileNote, Mark
from dvtcli.domain.rules.finding import FileComplaint
from dvtcli.domain.text import plural
from dvtcli.errors import InputFileError

#: maximum number of complaints to show
MOST_COMPLAINTS = 100


class FileLog:
    """Complaints and notes about the text of *file*; repeats by defaults are merged."""

    def __init__(self, file: str, text: str) -> None:
        self.file = file
        self._lines = text.split("\n")
        self._complaints: dict[FileComplaint, None] = {}
        self._notes: dict[str, list[Mark]] = {}
        self._nearest: dict[tuple[str, tuple[str, ...], float], str | None] = {}

    def complain(self, mark: Mark, text: str) -> None:
        """Record an error at *mark*."""
        self._complaints.setdefault(self.shown(mark, text))

    def shown(self, mark: Mark, text: str) -> FileComplaint:
        """Return *text* as a complaint with the line of *mark*, without recording it."""
        return FileComplaint(
            self.file, mark.line, mark.column, text, mark.width, self._line(mark.line), self._line(mark.line - 1)
        )

    def _line(self, number: int) -> str:
        return self._lines[number - 1].rstrip("\r") if 1 <= number <= len(self._lines) else ""

    @property
    def count(self) -> int:
        """The number of complaints so far."""
        return len(self._complaints)

    @property
    def is_silent(self) -> bool:
        """Whether no complaint has been recorded."""
        return not self._complaints

    def unknown(self, mark: Mark, key: str, where: str, known: Iterable[str]) -> None:
        """Complain about the unknown key *key* of *where*, and suggest a name of *known*."""
        known = tuple(known)
        near = self.nearest(key, known)
        said = f"did you mean {near!r}?" if near else f"known are {', '.join(known)}"
        self.complain(mark, f"unknown key {key[:40]!r} in {where}, {said}")

    def nearest(self, key: str, known: Iterable[str], cutoff: float = 0.6) -> str | None:
        """Return the name of *known* that *key* may be a slip of; cached for nodes with the same defaults."""
        asked = (key, tuple(known), cutoff)
        if asked not in self._nearest:
            self._nearest[asked] = nearest(*asked)
        return self._nearest[asked]

    def note(self, mark: Mark, text: str) -> None:
        """Record that the content at *mark* is correct but has no effect."""
        marks = self._notes.setdefault(text, [])
        if mark not in marks:
            marks.append(mark)

    def notes(self) -> tuple[FileNote, ...]:
        """Return every note once, in order of first places."""
        return tuple(
            sorted((FileNote(text, min(marks), len(marks)) for text, marks in self._notes.items()), key=_place)
        )

    def end(self, *, read: bool = False) -> None:
        """Raise InputFileError with all complaints, if any; *read*: nodes were read to find them."""
        if not self._complaints:
            return
        found = sorted(self._complaints)
        error = InputFileError(f"{self.file}: {plural(len(found), 'error')}", place=found[0].place)
        error.outcome = "nothing was written" if read else "nothing was sent"
        error.hides_others = not read
        error.complaints = tuple(found[:MOST_COMPLAINTS])
        raise error


def nearest(key: str, known: Iterable[str], cutoff: float = 0.6) -> str | None:
    """Return the name of *known* that *key* misspells or begins; ignores case and - for _."""
    from difflib import get_close_matches

    names, typed = {spelled(name): name for name in reversed(list(known))}, spelled(key)
    words = list(reversed(names))
    edited = [word for word in words if typed == word or _one_edit_apart(typed, word)]
    begun = [word for word in words if len(typed) >= 3 and word.startswith(typed)]
    found = [*sorted(edited, key=typed.__ne__), *get_close_matches(typed, words, n=1, cutoff=cutoff), *begun]
    return names[found[0]] if found else None


def spelled(key: str) -> str:
    """*key* as keys of a network file are spelt: small letters, and _ between words."""
    return key.strip().casefold().replace("-", "_").replace(" ", "_")


def _one_edit_apart(typed: str, name: str) -> bool:
    """Whether the words differ by one inserted, deleted or replaced character, or one swap."""
    if len(typed) == 2:
        return typed == name[::-1]
    if min(len(typed), len(name)) < 3 or abs(len(typed) - len(name)) > 1:
        return False
    same = next((at for at, (a, b) in enumerate(zip(typed, name, strict=False)) if a != b), min(len(typed), len(name)))
    left, right = typed[same:], name[same:]
    return (
        left[1:] == right[1:] or left[1:] == right or left == right[1:]
        or (left[:2] == right[:2][::-1] and left[2:] == right[2:])
    )  # fmt: skip


def _place(note: FileNote) -> Mark:
    return note.mark
