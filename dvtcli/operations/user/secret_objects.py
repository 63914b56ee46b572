"""Keep passcodes off screens and files: in frames and typed lines."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from dvtcli.domain.object_dictionary import ObjectDictionary, normalised
from dvtcli.domain.ports import Frame
from dvtcli.domain.sdo_frame import SdoValues
from dvtcli.files.profiles import passcode_objects

#: a frame for `send`, even if invalid: half a byte, too many bytes, or a wrong length
_FRAME = re.compile(
    r"\b(?:0x)?([56][0-9a-f]{2})(?:\s*#\s*|(?:\s+\[\d+\])?\s+)((?:(?:0x)?[0-9a-f]{1,2}[\s._]*)+)", re.IGNORECASE
)


@dataclass(frozen=True, slots=True)
class Secrets:
    """The objects that take a passcode, by all profiles: values written there are never shown or recorded."""

    objects: frozenset[tuple[int, int]]

    @classmethod
    def known(cls) -> Secrets:
        """Return those of all profiles; raises InputFileError for an invalid user profile."""
        return cls(passcode_objects())

    def in_frames(self, *, unknown: bool = False) -> SdoValues:
        """Return a follower of the bus that finds passcodes in frames; *unknown* as in `SdoValues`."""
        return SdoValues(self.objects, unknown=unknown)

    def in_line(self, line: str, dictionaries: Iterable[ObjectDictionary] = ()) -> bool:
        """Tell whether a typed *line* may hold a passcode: it names an object that takes one.

        By number in any notation, by a name in *dictionaries*, or as a frame that carries, or may carry, the object: a
        part of a transfer that the line does not identify.
        """
        followed = self.in_frames(unknown=True)
        if any(followed.value_in(frame) is not None for frame in _frames(line)):
            return True
        words = re.sub(r"[:./-]", " ", line.lower().replace("0x", ""))
        words = re.sub(r"\b([0-9a-f]{1,4})h\b", r"\1", words)
        if any(re.search(rf"\b(?:{index:04x}|{index})\s+0*{sub:x}\b", words) for index, sub in self.objects):
            return True
        found = (dictionary.entry(*place) for dictionary in dictionaries for place in self.objects)
        typed = normalised(line)
        names = (name for entry in found if entry is not None for name in (entry.name, entry.denotation))
        return any(name in typed for name in map(normalised, names) if name)


def _frames(line: str) -> Iterator[Frame]:
    """Yield SDO frames found in *line*."""
    for can_id, data in _FRAME.findall(line):
        digits = re.sub(r"0x|[\s._]", "", data, flags=re.IGNORECASE)
        yield Frame(int(can_id, 16), bytes.fromhex(digits + "0" * (len(digits) % 2))[:8])
