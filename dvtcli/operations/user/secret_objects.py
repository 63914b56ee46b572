"""What no screen and no file may show: passcodes, on the wire and in typed lines. Does not know who shows anything."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass

from dvtcli.domain.object_dictionary import ObjectDictionary, normalised
from dvtcli.domain.ports import Frame
from dvtcli.domain.sdo_frame import sdo_value_of
from dvtcli.domain.typed_frame import typed_frame
from dvtcli.files.profile.library import passcode_objects


@dataclass(frozen=True, slots=True)
class Secrets:
    """The objects that take a passcode, of every profile: what is written there is shown and recorded nowhere."""

    objects: frozenset[tuple[int, int]]

    @classmethod
    def known(cls) -> Secrets:
        """Those of all profiles; InputFileError where one of the user's own is wrong."""
        return cls(passcode_objects())

    def in_frame(self, frame: Frame) -> bool:
        """Whether *frame* is an SDO that carries a passcode."""
        return sdo_value_of(frame) in self.objects

    def in_line(self, line: str, dictionaries: Iterable[ObjectDictionary] = ()) -> bool:
        """Whether a typed *line* names an object that takes a passcode, and so may hold one.

        By number in any notation, by one of the names that *dictionaries* have for it, or as a frame that carries it.
        """
        if "#" in line and any(map(self.in_frame, _frames(line))):
            return True
        words = line.lower().replace("0x", "").replace(":", " ").replace("-", " ")
        words = re.sub(r"\b([0-9a-f]{1,4})h\b", r"\1", words)
        if any(re.search(rf"\b(?:{index:04x}|{index})\s+0*{sub:x}\b", words) for index, sub in self.objects):
            return True
        found = (one.entry(*place) for one in dictionaries for place in self.objects)
        typed = normalised(line)
        names = (name for entry in found if entry is not None for name in (entry.name, entry.denotation))
        return any(name in typed for name in map(normalised, names) if name)


def _frames(line: str) -> Iterator[Frame]:
    """The words of *line* that are frames, as `send` takes them."""
    for word in line.split():
        with suppress(ValueError):
            yield typed_frame(word.strip("'\""))
