"""What is on disk while a device is being changed, so that a killed change can be finished.

A journal is written whole and synced before the first write, and removed once the change is verified or undone.
Knows folders and files of its own. Does not write to devices and does not decide when to recover.
"""

from __future__ import annotations

import errno
import json
import os
import re
import tempfile
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from dvtcli.device.change.whole import Part
from dvtcli.device.trust import private_folder, stranger
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.mapping import MAX_ENTRIES, PdoMappingEntry
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig
from dvtcli.domain.plan import Change, PdoChange, Plan, Step, ValueChange, plan_pdo
from dvtcli.errors import InputFileError, SafetyRefusal

SCHEMA = "dvtcli.journal/1"
#: A journal holds at most 1,024 PDOs and as many single objects; anything larger is something else.
MOST_BYTES, _MOST_CHANGES = 4_000_000, 2048

#: What a journal's new name says of it: closed with what the device held, or set aside unused.
ACCEPTED, DISCARDED = "accepted", "discarded"

Identity = dict[str, int | None]


@dataclass(frozen=True, slots=True)
class Journal:
    """An interrupted change: the node it was made on, its plan, and the NMT state that was found (None: unknown).

    *part* says what it belongs to.
    """

    path: Path
    bus: str
    identity: Identity
    plan: Plan
    nmt_state: int | None = None
    part: Part = field(default_factory=Part)


@dataclass(frozen=True, slots=True)
class Journals:
    """The journals of one *folder* for the bus called *bus*."""

    folder: Path
    bus: str

    def path(self, node_id: int) -> Path:
        """Where the journal of *node_id* is, whether there is one or not."""
        return self.folder / f"{file_name(self.bus)}-{node_id}.json"

    def find(self, node_id: int) -> Journal | None:
        """The journal of *node_id*, or None; InputFileError where it is damaged."""
        path = self.path(node_id)
        return read_journal(path) if path.exists() else None

    def _marker(self, whole: str) -> Path:
        return self.folder / f"{whole}.whole"

    def open_whole(self, whole: str) -> None:
        """Before the first journal of the *whole* of this id: they count for as long as this lasts."""
        if not self._marker(whole).exists():
            write_private(self._marker(whole), "")

    def close_whole(self, whole: str) -> None:
        """The *whole* is complete, or put back: what is left of its journals counts no longer, at one stroke."""
        if self._marker(whole).exists():
            self._marker(whole).unlink()
            _sync_folder(self.folder)

    def counts(self, path: Path) -> bool:
        """Whether there is a journal at *path* (a damaged one is one, too), and it is of no whole that is complete."""
        if not path.exists():
            return False
        try:
            whole = read_journal(path).part.whole
        except (InputFileError, SafetyRefusal):
            return True
        return whole is None or Journals(path.parent, self.bus)._marker(whole).exists()  # noqa: SLF001 - one of ours

    def all_of(self, whole: str) -> list[Journal]:
        """The journals that belong to the *whole* of this id, by node-ID; those that cannot be used are passed over."""
        found = []
        for path in self.folder.glob(f"{file_name(self.bus)}-*.json"):
            with suppress(InputFileError, SafetyRefusal):
                found.append(read_journal(path))
        ours = (one for one in found if (one.bus, one.part.whole) == (self.bus, whole))
        return sorted(ours, key=lambda one: one.plan.node_id)

    def write(self, plan: Plan, identity: Identity, nmt_state: int | None, part: Part | None = None) -> Path:
        """Put *plan*, which belongs to *part*, on disk, whole and synced, before its first write; for its owner only.

        OSError where it cannot be kept, or is too large to be read again.
        """
        path, part = self.path(plan.node_id), part or Part()
        document = {
            "schema": SCHEMA,
            "bus": self.bus,
            "node": plan.node_id,
            "identity": identity,
            "nmt_state": nmt_state,
            "whole": part.whole,
            "name": part.name,
            "entries": list(part.entries),
            "final": part.final,
            "changes": [change_document(change) for change in plan.changes],
        }
        text = json.dumps(document, indent=1)
        if len(text) > MOST_BYTES or len(plan.changes) > _MOST_CHANGES:
            raise OSError(errno.EFBIG, os.strerror(errno.EFBIG), str(path))
        write_private(path, text)
        return path

    def remove(self, node_id: int) -> None:
        """Forget the journal of *node_id*: its change is verified, or undone and verified."""
        path = self.path(node_id)
        path.unlink(missing_ok=True)
        _sync_folder(path.parent)


def file_name(text: str) -> str:
    """*text* with everything that a file name should not have as `_`."""
    return re.sub(r"[^A-Za-z0-9.]+", "_", text).strip("_") or "bus"


def write_private(path: Path, text: str) -> None:
    """Write a file whole or not at all, readable by its owner only, and on the disk when this returns.

    A link of that name is replaced, never followed. SafetyRefusal where others can write its folder or the one above,
    which is the state folder.
    """
    private_folder(path.parent.parent)
    private_folder(path.parent)
    descriptor, temporary = tempfile.mkstemp(dir=path.parent)  # 0600
    try:
        with os.fdopen(descriptor, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)  # noqa: PTH105 - atomic on every platform
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    _sync_folder(path.parent)


def set_aside(path: Path, word: str) -> Path:
    """Give *path* a name that nobody looks for, with *word* and the time in it; returns that name."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%fZ")
    aside = path.with_name(f"{path.name}.{word}-{stamp}")
    os.replace(path, aside)  # noqa: PTH105 - atomic on every platform
    _sync_folder(path.parent)
    return aside


def _sync_folder(folder: Path) -> None:
    """Make a new or removed name durable; folders cannot be opened for that on Windows, and there may be none."""
    if os.name == "nt" or not folder.is_dir():
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def change_document(change: Change) -> dict[str, Any]:
    """A change as JSON, from which `read_plan` makes it again."""
    if isinstance(change, ValueChange):
        step = change.step
        before = None if step.before is None else step.before.hex()
        return {"object": [step.index, step.sub_index], "before": before, "after": step.after.hex()}
    return {"pdo": str(change.pdo), "before": _config_document(change.before), "after": _config_document(change.after)}


def _config_document(config: PdoConfig) -> dict[str, Any]:
    parameter = config.communication
    return {
        "cob_id": parameter.cob_id.raw,
        "transmission_type": parameter.transmission_type,
        "inhibit_time": parameter.inhibit_time,
        "event_timer": parameter.event_timer,
        "sync_start_value": parameter.sync_start_value,
        "mapping": [entry.raw for entry in config.mapping],
        "mpdo": config.mpdo,
    }


def read_journal(path: Path) -> Journal:
    """Read a journal; InputFileError, naming the file and what is wrong, where it is damaged or no journal.

    SafetyRefusal where somebody else could have written it.
    """
    try:
        with path.open("rb") as file:
            _refuse_strangers(path, os.fstat(file.fileno()))
            data = file.read(MOST_BYTES + 1)
        document = json.loads(data) if len(data) <= MOST_BYTES else None
        return _Reader(path).journal(document)
    except (ValueError, RecursionError, OSError) as wrong:
        raise InputFileError(
            f"{path} is not a journal that can be used",
            place=str(path),
            why=str(wrong),
            hint="`recover --discard` sets the file aside (it is kept under another name); then look at the node with "
            "`pdo`, and set it as it should be, or `undo --backup` puts an automatic backup back",
        ) from wrong


def _refuse_strangers(path: Path, status: os.stat_result) -> None:
    """A journal says what is written to a device: SafetyRefusal where that may be somebody else's word."""
    found = stranger(str(path), status)
    if found is not None:
        raise SafetyRefusal(f"{path} is not used: {found[0]}", place=str(path), hint=found[1])


def read_plan(document: Any) -> tuple[Identity, Plan]:
    """The identity and the plan that a JSON document tells; ValueError says which part is wrong."""
    return _Reader(Path()).plan(document)


@dataclass(frozen=True, slots=True)
class _Reader:
    """Turns a JSON document into a journal; ValueError says which part is wrong."""

    path: Path
    limits: dict[str, int] = field(
        default_factory=lambda: {
            "transmission_type": 0xFF,
            "inhibit_time": 0xFFFF,
            "event_timer": 0xFFFF,
            "sync_start_value": 0xFF,
        }
    )

    def journal(self, document: Any) -> Journal:
        if not isinstance(document, dict) or document.get("schema") != SCHEMA:
            raise ValueError(f"it does not say {SCHEMA}")
        identity, plan = self.plan(document)
        state = document.get("nmt_state")
        return Journal(
            self.path,
            str(document.get("bus", "")),
            identity,
            plan,
            None if state is None else _number(document, "nmt_state", 0xFF),
            _part(document),
        )

    def plan(self, document: Any) -> tuple[Identity, Plan]:
        changes = document.get("changes") if isinstance(document, dict) else None
        if not isinstance(changes, list) or not changes or len(changes) > _MOST_CHANGES:
            raise ValueError("it names no changes")
        plan = Plan(_number(document, "node", 127, least=1), tuple(self.change(change) for change in changes))
        identity = document.get("identity")
        if not isinstance(identity, dict) or not all(
            isinstance(key, str) and (value is None or type(value) is int) for key, value in identity.items()
        ):
            raise ValueError("identity is malformed")
        return identity, plan

    def change(self, document: Any) -> Change:
        if not isinstance(document, dict):
            raise ValueError("a change is malformed")
        if "pdo" in document:
            pdo = Pdo.parse(str(document["pdo"]))
            before, after = (self.config(document.get(key)) for key in ("before", "after"))
            if (before.mpdo, after.mpdo) != (None, None):
                raise ValueError("a multiplexed PDO is never changed")
            change: PdoChange = plan_pdo(pdo, before, after)
            return change
        return self.value(document)

    def value(self, document: dict[str, Any]) -> ValueChange:
        where = document.get("object")
        if not isinstance(where, list) or len(where) != 2:
            raise ValueError("an object is malformed")
        index, sub_index = (_number({"": part}, "", most) for part, most in zip(where, (0xFFFF, 0xFF), strict=True))
        before = document.get("before")
        held = None if before is None else bytes.fromhex(str(before))
        return ValueChange(Step(index, sub_index, held, bytes.fromhex(str(document.get("after"))), "write"))

    def config(self, document: Any) -> PdoConfig:
        if not isinstance(document, dict):
            raise ValueError("a configuration is malformed")
        times = {
            key: None if document.get(key) is None else _number(document, key, most)
            for key, most in self.limits.items()
        }
        words = document.get("mapping")
        if not isinstance(words, list) or len(words) > MAX_ENTRIES:
            raise ValueError("a mapping is malformed")
        entries = tuple(PdoMappingEntry.from_raw(_number({"": word}, "", 0xFFFF_FFFF)) for word in words)
        communication = PdoCommunicationParameter(CobId.from_raw(_number(document, "cob_id", 0xFFFF_FFFF)), **times)
        mpdo = None if document.get("mpdo") is None else _number(document, "mpdo", 0xFF)
        return PdoConfig(communication, entries, mpdo)


def _part(document: dict[str, Any]) -> Part:
    """What the journal belongs to; those of earlier versions do not say, and stand alone."""
    whole, name, final = document.get("whole"), document.get("name", ""), document.get("final", "")
    entries = document.get("entries", [])
    if not isinstance(entries, list) or not all(isinstance(one, str) for one in (whole or "", name, final, *entries)):
        raise ValueError("what it belongs to is malformed")
    return Part(whole, name, tuple(entries), final)


def _number(document: dict[str, Any], key: str, most: int, least: int = 0) -> int:
    value = document.get(key)
    if type(value) is not int or not least <= value <= most:
        raise ValueError(f"{key or 'a number'} is {value!r}, expected {least}..{most}")
    return value
