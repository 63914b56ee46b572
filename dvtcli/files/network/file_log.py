"""What is found while a network file is read: complaints, all of them, and notes. Knows lines, not what they mean."""

from __future__ import annotations

from collections.abc import Iterable

from dvtcli.domain.file_complaint import FileComplaint
from dvtcli.domain.network.wanted_state import FileNote, Mark
from dvtcli.domain.several import plural
from dvtcli.errors import InputFileError

#: nobody mends more than this at once
MOST_COMPLAINTS = 100


class FileLog:
    """Complaints and notes about the text of *file*; what defaults bring to several nodes is said once."""

    def __init__(self, file: str, text: str) -> None:
        self.file = file
        self._lines = text.split("\n")
        self._complaints: dict[FileComplaint, None] = {}
        self._notes: dict[str, list[Mark]] = {}
        self._nearest: dict[tuple[str, tuple[str, ...], float], str | None] = {}

    def complain(self, mark: Mark, text: str) -> None:
        """Something at *mark* is wrong."""
        self._complaints.setdefault(self.shown(mark, text))

    def shown(self, mark: Mark, text: str) -> FileComplaint:
        """*text* with the line that *mark* is in; nothing is complained."""
        return FileComplaint(
            self.file, mark.line, mark.column, text, mark.width, self._line(mark.line), self._line(mark.line - 1)
        )

    def _line(self, number: int) -> str:
        return self._lines[number - 1].rstrip("\r") if 1 <= number <= len(self._lines) else ""

    @property
    def count(self) -> int:
        """How many complaints there are so far."""
        return len(self._complaints)

    @property
    def is_silent(self) -> bool:
        """Whether nothing is wrong so far."""
        return not self._complaints

    def unknown(self, mark: Mark, key: str, where: str, known: Iterable[str]) -> None:
        """The key *key* of *where* is not one of *known*."""
        known = tuple(known)
        near = self.nearest(key, known)
        said = f"did you mean {near!r}?" if near else f"known are {', '.join(known)}"
        self.complain(mark, f"unknown key {key[:40]!r} in {where}, {said}")

    def nearest(self, key: str, known: Iterable[str], cutoff: float = 0.6) -> str | None:
        """The one of *known* that *key* may be a slip of; searched once, however many nodes have it by defaults."""
        asked = (key, tuple(known), cutoff)
        if asked not in self._nearest:
            self._nearest[asked] = nearest(*asked)
        return self._nearest[asked]

    def note(self, mark: Mark, text: str) -> None:
        """Something at *mark* is no fault, and is not carried out."""
        marks = self._notes.setdefault(text, [])
        if mark not in marks:
            marks.append(mark)

    def notes(self) -> tuple[FileNote, ...]:
        """Every note once, in the order of its first places."""
        return tuple(
            sorted((FileNote(text, min(marks), len(marks)) for text, marks in self._notes.items()), key=_place)
        )

    def end(self, *, read: bool = False) -> None:
        """InputFileError with every complaint, where there is one; *read*: nodes were asked to find it."""
        if not self._complaints:
            return
        found = sorted(self._complaints)
        outcome = "nothing was written" if read else "nothing was sent"
        error = InputFileError(f"{self.file}: {plural(len(found), 'error')}; {outcome}", place=found[0].place)
        error.outcome = outcome
        error.complaints = tuple(found[:MOST_COMPLAINTS])
        raise error


def nearest(key: str, known: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The one of *known* that *key* may be a slip of, or the beginning of; letter case and - for _ count as slips."""
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
    """Whether one character more, less or other, or two swapped ones, are all that parts the two words."""
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
