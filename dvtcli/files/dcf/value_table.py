"""The table `[xxxxValue]` of an object in short form (CiA 306, 4.6.3.3): rows changed, put in and taken out.

Does not know what a row's text means.
"""

from __future__ import annotations

from dvtcli.files.dcf.edited_text import EditedText
from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.ini import IniValue, Values, section_values
from dvtcli.files.eds.layout import ObjectSections
from dvtcli.files.eds.numbers import read_number

_COUNT = "nrofentries"


class ValueTable:
    """The table of the object that *sections* describe, in *text*; `write` carries out what was asked."""

    def __init__(self, text: EditedText, sections: ObjectSections) -> None:
        self._text, self._sections = text, sections
        self._keys = section_values(sections.values, Findings())
        #: by sub-index
        self.rows: dict[int, IniValue] = dict(_rows(self._keys))
        self._wanted: dict[int, str] = {}
        self._taken_out: set[int] = set()

    def set(self, sub_index: int, value: str, *, is_text: bool) -> None:
        """Let the row of *sub_index* say *value*."""
        if sub_index in self.rows:
            self._text.set_value(self.rows[sub_index].line, value, is_text=is_text)
        else:
            self._wanted[sub_index] = value

    def remove(self, sub_index: int) -> None:
        """Let the table say nothing of *sub_index*."""
        if sub_index in self.rows:
            self._text.remove(self.rows[sub_index].line)
            self._taken_out.add(sub_index)

    def write(self) -> None:
        """Put the new rows where they belong, in order, and count them."""
        if not self._sections.values:
            if self._wanted:
                self._text.insert(self._end_of_object(), ["", *self._new_table()])
            return
        if self._wanted or self._taken_out:
            self._count()
        first = self._keys[_COUNT].line if _COUNT in self._keys else self._sections.values[-1].line
        for sub_index, value in sorted(self._wanted.items()):
            before = [row.line for number, row in self.rows.items() if number < sub_index]
            self._text.insert_key(max([first, *before]), str(sub_index), value)

    def _new_table(self) -> list[str]:
        rows = [f"{sub_index}={value}" for sub_index, value in sorted(self._wanted.items())]
        return [f"[{self._sections.own[0].name}Value]", f"NrOfEntries={len(rows)}", *rows]

    def _count(self) -> None:
        count = str(len(self._keys) - (_COUNT in self._keys) - len(self._taken_out) + len(self._wanted))
        if _COUNT not in self._keys:
            self._text.insert_key(self._sections.values[-1].line, "NrOfEntries", count)
        else:
            self._text.set_value(self._keys[_COUNT].line, count)

    def _end_of_object(self) -> int:
        """The last line of the object's sections that is not empty."""
        last = max((part for parts in self._sections.each() for part in parts), key=lambda part: part.line)
        lines = last.text.split("\n")
        return last.line + max(number for number, line in enumerate(lines) if not number or line.strip())


def _rows(keys: Values) -> list[tuple[int, IniValue]]:
    found = []
    for key, row in keys.items():
        try:
            found.append((read_number(row.key), row)) if key != _COUNT else None
        except ValueError:
            continue  # the reader says so
    return found
