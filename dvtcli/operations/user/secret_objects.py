"""What no screen and no file may show: passcodes, on the wire and in typed lines. Does not know who shows anything."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from dvtcli.domain.object_dictionary import ObjectDictionary, normalised
from dvtcli.domain.ports import Frame
from dvtcli.domain.sdo_frame import SdoValues
from dvtcli.files.profile.library import passcode_objects

#: a frame as `send` takes it, also where it is none yet: with half a byte, too many of them, or a wrong length
_FRAME = re.compile(
    r"\b(?:0x)?([56][0-9a-f]{2})(?:\s*#\s*|(?:\s+\[\d+\])?\s+)((?:(?:0x)?[0-9a-f]{1,2}[\s._]*)+)", re.IGNORECASE
)


@dataclass(frozen=True, slots=True)
class Secrets:
    """The objects that take a passcode, of every profile: what is written there is shown and recorded nowhere."""

    objects: frozenset[tuple[int, int]]

    @classmethod
    def known(cls) -> Secrets:
        """Those of all profiles; InputFileError where one of the user's own is wrong."""
        return cls(passcode_objects())

    def in_frames(self, *, unknown: bool = False) -> SdoValues:
        """What follows the frames of a bus and tells where a passcode is; *unknown* as there."""
        return SdoValues(self.objects, unknown=unknown)

    def in_line(self, line: str, dictionaries: Iterable[ObjectDictionary] = ()) -> bool:
        """Whether a typed *line* names an object that takes a passcode, and so may hold one.

        By number in any notation, by one of the names that *dictionaries* have for it, or as a frame that carries it,
        or may: a part of a transfer whose object the line does not name.
        """
        followed = self.in_frames(unknown=True)
        if any(followed.value_in(frame) is not None for frame in _frames(line)):
            return True
        words = line.lower().replace("0x", "").replace(":", " ").replace("-", " ")
        words = re.sub(r"\b([0-9a-f]{1,4})h\b", r"\1", words)
        if any(re.search(rf"\b(?:{index:04x}|{index})\s+0*{sub:x}\b", words) for index, sub in self.objects):
            return True
        found = (dictionary.entry(*place) for dictionary in dictionaries for place in self.objects)
        typed = normalised(line)
        names = (name for entry in found if entry is not None for name in (entry.name, entry.denotation))
        return any(name in typed for name in map(normalised, names) if name)


def _frames(line: str) -> Iterator[Frame]:
    """What in *line* looks like an SDO's frame."""
    for can_id, data in _FRAME.findall(line):
        digits = re.sub(r"0x|[\s._]", "", data, flags=re.IGNORECASE)
        yield Frame(int(can_id, 16), bytes.fromhex(digits + "0" * (len(digits) % 2))[:8])
