"""What devices of one identity (0x1018, without the serial number) were found to want; later processes know it, too.

One file an identity. Does not know how anything is found out, nor writes to a device.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dvtcli.device.change.plan_document import Identity
from dvtcli.device.change.private_file import write_private
from dvtcli.domain.pdo import Direction
from dvtcli.errors import SafetyRefusal

SCHEMA = "dvtcli.habits/1"
_MOST_BYTES = 10_000

#: A parameter of the PDOs of one direction, by its sub-index.
Parameter = tuple[Direction, int]


@dataclass(slots=True)
class Habits:
    """The parameters that a device takes only while their PDO is off, kept in *folder*; *say* shows what goes wrong."""

    folder: Path | None = None
    say: Callable[[str], None] = lambda _text: None
    _known: dict[str, frozenset[Parameter]] = field(default_factory=dict)

    @property
    def are_there(self) -> bool:
        """Whether anything is known of any device: else nobody need be asked who it is."""
        return bool(self._known) or (self.folder is not None and any(self.folder.glob("*.json")))

    def off_first(self, identity: Identity) -> frozenset[Parameter]:
        """What the device of *identity* takes only while the PDO is off, as far as it is known."""
        name = _name(identity)
        if name not in self._known:
            self._known[name] = frozenset() if self.folder is None else frozenset(self._read(self.folder / name))
        return self._known[name]

    def add(self, identity: Identity, parameter: Parameter) -> None:
        """It was found out that the device of *identity* takes *parameter* only while the PDO is off."""
        name = _name(identity)
        known = self._known[name] = self.off_first(identity) | {parameter}
        if self.folder is None:
            return
        document = {"schema": SCHEMA, "off_first": sorted([str(direction), sub] for direction, sub in known)}
        try:
            write_private(self.folder / name, json.dumps(document))
        except (OSError, SafetyRefusal) as failed:
            self.say(f"what this device wants cannot be remembered: {failed}")

    def _read(self, path: Path) -> Iterable[Parameter]:
        try:
            with path.open("rb") as file:
                document = json.loads(file.read(_MOST_BYTES))
            return _parameters(document)
        except FileNotFoundError:
            return ()
        except (OSError, ValueError, RecursionError) as wrong:
            self.say(f"{path} does not tell what this device wants ({wrong}): it is found out anew")
            return ()


def _parameters(document: Any) -> list[Parameter]:
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise ValueError(f"it does not say {SCHEMA}")
    found = []
    for one in document.get("off_first", ()):
        if not isinstance(one, list) or len(one) != 2 or one[1] not in range(2, 7):
            raise ValueError("off_first is malformed")
        found.append((Direction(one[0]), int(one[1])))
    return found


def _name(identity: Identity) -> str:
    words = [identity.get(name) for name in ("vendor", "product", "revision")]
    return "-".join("none" if word is None else f"{word:08X}" for word in words) + ".json"
