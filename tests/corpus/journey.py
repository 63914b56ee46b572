"""The way of one file through the whole tool: read, check, simulate, map, verify, store, undo; and what came of it.

Every step is judged by what an independent client reads of the device, never by what the tool says of itself.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from zlib import crc32

from dvtcli.domain.datatypes import Kind
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import Direction, Pdo
from dvtcli.domain.ports import Frame
from dvtcli.files.device_file import read_device_file
from tests.cli.commands.bench import Bench, Ran
from tests.corpus.independent import Independent, RawPdo

RIGHT, REFUSED, WRONG = "right", "refused", "wrong"
_INITIATE_DOWNLOAD = 1
#: A change that was refused before any write ends with one of these: rules, usage, safety.
_REFUSALS = (1, 2, 6)
_MOST_PDOS = 4
Place = tuple[int, int]


@dataclass(frozen=True)
class Outcome:
    """What came of one step: *verdict* is right, refused or wrong; *why* is for people."""

    step: str
    verdict: str
    why: str = ""


@dataclass
class Journey:
    """One file on its way."""

    path: Path
    outcomes: list[Outcome] = field(default_factory=list)

    @property
    def wrong(self) -> list[Outcome]:
        return [outcome for outcome in self.outcomes if outcome.verdict == WRONG]

    def count(self, verdict: str) -> int:
        return sum(outcome.verdict == verdict for outcome in self.outcomes)

    def note(self, step: str, verdict: str, why: str = "") -> None:
        self.outcomes.append(Outcome(step, verdict, " ".join(why.split())[:300]))


def travel(path: Path, share: int = 1) -> Journey:
    """Take the file at *path* through everything; never raises. Each PDO is changed in one of *share* of all ways."""
    journey = Journey(path)
    try:
        dictionary = read_device_file(path).dictionary
        with Bench((str(path),), {"yes": True}, in_real_time=True) as bench:
            _check(bench, journey)
            _Trip(bench, journey, dictionary, share).go()
    except Exception as failed:
        journey.note("anything", WRONG, f"{type(failed).__name__}: {failed}")
        if "-v" in sys.argv:
            raise
    return journey


def _check(bench: Bench, journey: Journey) -> None:
    ran = bench.run(f"eds check '{journey.path}'")
    journey.note("eds check", RIGHT if ran.code in (0, 4) else WRONG, ran.stderr)


class _Trip:
    """A session on the simulated node of a file, with an independent client beside it."""

    def __init__(self, bench: Bench, journey: Journey, dictionary: ObjectDictionary, share: int) -> None:
        self.bench, self.journey, self.dictionary, self.share = bench, journey, dictionary, share
        self.turn = crc32(journey.path.name.encode())
        self.listed = sorted({pdo for index in dictionary if (pdo := Pdo.at(index)) is not None})
        self.writes = 0
        #: PDOs of which it was said that they are not put back as they were
        self.named: set[Pdo] = set()

    def go(self) -> None:
        self.bench.session.node()
        self.client = Independent(self.bench)
        try:
            self.bench.session.open_network().bus.tap(self._received)
            self._look()
            self._change()
            self._store()
        finally:
            self.client.close()

    def _received(self, frame: Frame, sent: bool) -> None:
        if sent and 0x601 <= frame.can_id <= 0x67F and frame.data[0] >> 5 == _INITIATE_DOWNLOAD:
            self.writes += 1

    def _raw(self) -> dict[Pdo, RawPdo]:
        places = {(pdo.communication_index, pdo.mapping_index): pdo for pdo in self.listed}
        return {places[place]: raw for place, raw in self.client.pdos(places).items()}

    def _one(self, pdo: Pdo) -> RawPdo:
        place = (pdo.communication_index, pdo.mapping_index)
        return self.client.pdos([place])[place]

    def _look(self) -> None:
        """Every PDO that the node has anything of is in the list, and is what it is."""
        ran = self.bench.run("pdo --all --json")
        if ran.code:
            self.journey.note("pdo --all", WRONG, ran.stderr)
            return
        shown = {row["pdo"]: row for row in ran.document["pdos"]}
        for pdo, raw in self._raw().items():
            wrong = _unlike_raw(shown.get(str(pdo)), raw)
            self.journey.note(f"pdo {pdo}", WRONG if wrong else RIGHT, wrong)
        text = self.bench.run("pdo")
        self.journey.note("pdo", WRONG if text.code else RIGHT, text.stderr)

    def _change(self) -> None:
        factory = self._raw()
        for direction in Direction:
            for pdo in [pdo for pdo in self.listed if pdo.direction is direction][:_MOST_PDOS]:
                for line in list(self._lines(pdo))[self.turn % self.share :: self.share]:
                    self._try(pdo, line)
                self.turn += 1
        after = self._raw()
        for pdo, raw in factory.items():
            if raw != after[pdo] and pdo not in self.named:
                self.journey.note(f"{pdo} in the end", WRONG, f"{raw} became {after[pdo]}")

    def _lines(self, pdo: Pdo) -> Iterator[str]:
        objects = self._mappable(pdo.direction)
        if objects:
            yield f"map {pdo} {objects[0]}"
            yield f"map {pdo} {objects[-1]} --off"
            yield f"map {pdo} {' '.join(objects[:8])}"
            yield f"map {pdo} {' '.join(objects)}"
            yield f"map {pdo} {objects[0]} --cob-id keep"
            yield f"map {pdo} {objects[0]} --cob-id 0x6A{pdo.number % 16:X} --type 1 --rtr"
            if not pdo.is_tpdo:
                yield f"map {pdo} dummy/8 {objects[0]}"
        yield from (f"{word} {pdo}" for word in ("disable", "clear", "enable"))
        yield from (f"set {pdo} {words}" for words in ("--timer 50", "--inhibit 7", "--type 254", "--cob-id auto"))

    def _mappable(self, direction: Direction) -> list[str]:
        """Numbers that `objects` offers for the direction, two of each length at most but many single bits."""
        ran = self.bench.run(f"objects --mappable {direction} --json")
        rows = ran.document["objects"] if ran.code == 0 else []
        found: dict[int, list[str]] = {}
        for row in rows:
            index, _, sub_index = row["object"].partition(":")
            entry = self.dictionary.entry(int(index, 16), int(sub_index or "0", 16))
            kind = entry.data_type.kind if entry is not None and entry.data_type is not None else None
            if entry is not None and entry.bits and kind in (Kind.BOOLEAN, Kind.INTEGER, Kind.UNSIGNED):
                same = found.setdefault(entry.bits, [])
                if len(same) < (24 if entry.bits == 1 else 5):
                    same.append(row["object"])
        return [text for bits in sorted(found, key=lambda bits: (bits != 8, bits)) for text in found[bits]]

    def _try(self, pdo: Pdo, line: str) -> None:
        before, self.writes = self._one(pdo), 0
        ran = self.bench.run(line)
        after = self._one(pdo)
        if ran.code:
            self._judge_refusal(line, ran, before, after)
            return
        wrong = _unlike_asked(line, before, after, moved=self.writes > 0)
        if not wrong and (verified := self.bench.run(f"verify {pdo}")).code and self.writes:
            wrong = f"verify: {verified.stderr}{verified.stdout}"
        self.journey.note(line, WRONG if wrong else RIGHT, wrong)
        self._undo(pdo, line, ran, before)

    def _judge_refusal(self, line: str, ran: Ran, before: RawPdo, after: RawPdo) -> None:
        why = ""
        if ran.code not in _REFUSALS:
            why = f"exit {ran.code}: {ran.stderr}"
        elif self.writes:
            why = f"refused after {self.writes} writes: {ran.stderr}"
        elif before != after or "error: " not in ran.stderr:
            why = f"{before} became {after}: {ran.stderr}"
        rule = re.search(r"rule +(\S+)", ran.stderr)
        self.journey.note(line, WRONG if why else REFUSED, why or (rule[1] if rule else ran.stderr))

    def _undo(self, pdo: Pdo, line: str, changed: Ran, before: RawPdo) -> None:
        if "nothing was written" in changed.stdout:
            return
        ran = self.bench.run("undo")
        after = self._one(pdo)
        said = "an undo leaves it" in changed.stderr
        if ran.code not in (0, 1) or (ran.code == 0) is not (after == before):
            self.journey.note(f"undo of {line}", WRONG, f"exit {ran.code}, {before} became {after}: {ran.stderr}")
        elif after == before:
            self.journey.note(f"undo of {line}", RIGHT)
        elif not said:
            self.journey.note(f"undo of {line}", WRONG, f"{before} became {after}: {ran.stderr}")
        else:
            self.named.add(pdo)
            named = "refuses that configuration" in ran.stderr
            self.journey.note(f"undo of {line}", RIGHT if named else WRONG, f"{before} became {after}: {ran.stderr}")

    def _store(self) -> None:
        """Store a change, and look whether it is still there; then put it back."""
        for pdo in self.listed:
            objects = self._mappable(pdo.direction)
            if not objects or self.bench.run(f"map {pdo} {objects[0]} --off").code:
                continue
            held, self.writes = self._one(pdo), 0
            ran = self.bench.run("store")
            wrong = ""
            if ran.code and (self.writes or ran.code not in _REFUSALS):
                wrong = f"exit {ran.code} after {self.writes} writes: {ran.stderr}"
            elif ran.code == 0 and self.writes != 1:
                wrong = f"{self.writes} writes"
            elif self._one(pdo) != held:
                wrong = "what was stored is no longer held"
            self.journey.note("store", WRONG if wrong else REFUSED if ran.code else RIGHT, wrong or ran.stderr)
            break


def _unlike_raw(row: dict[str, Any] | None, raw: RawPdo) -> str:
    """What the list says otherwise than the device; empty where it is right."""
    if raw.cob_id is None and raw.count is None:
        return "" if row is None else f"shown, though there is nothing: {row}"
    if row is None:
        return f"hidden: {raw}"
    if row["enabled"] is raw.is_off:
        return f"enabled is {row['enabled']}: {raw}"
    if raw.cob_id is not None and row["cob_id"] != raw.cob_id & 0x1FFFFFFF:
        return f"CAN-ID 0x{row['cob_id']:X}: {raw}"
    readable = 0
    while readable < len(raw.entries) and raw.entries[readable] is not None:
        readable += 1
    multiplexed = raw.count in (0xFE, 0xFF)
    words = [] if multiplexed else [entry["object"] for entry in row["mapping"]]
    if not multiplexed and words != [_object(entry) for entry in raw.entries[:readable]]:
        return f"mapping {words}: {raw}"
    whole = raw.cob_id is not None and raw.count is not None and (multiplexed or readable == raw.count)
    return "" if (row["inconsistent"] is None) is whole else f"inconsistent is {row['inconsistent']}: {raw}"


def _object(entry: int | None) -> str:
    return f"{(entry or 0) >> 16:04X}:{(entry or 0) >> 8 & 0xFF:02X}"


def _unlike_asked(line: str, before: RawPdo, after: RawPdo, *, moved: bool) -> str:
    """What the device does not hold of what *line* asked; empty where it holds all of it."""
    word, _, *rest = line.split()
    objects = [one for one in rest if re.fullmatch(r"[0-9A-F]{4}:[0-9A-F]{2}", one)] if word == "map" else []
    expected: dict[str, tuple[object, object]] = {}
    off = word in ("disable", "clear") or "--off" in rest or (word == "set" and before.is_off)
    expected["off"] = (off, after.is_off)
    if word == "map":
        held = [_object(entry) for entry in after.entries]
        skipped = 1 if any(one.startswith("dummy") for one in rest) else 0
        expected["entries"] = (objects, held[skipped:])
        expected["count"] = (len(objects) + skipped, after.count)
    if word in ("disable", "enable", "set"):
        expected["mapping"] = ((before.count, before.entries), (after.count, after.entries))
    if word == "clear" and before.count is not None:
        expected["count"] = (0, after.count)
    if word in ("disable", "clear", "enable") and after.cob_id is not None:
        expected["COB-ID"] = ((before.cob_id or 0) & 0x7FFFFFFF, after.cob_id & 0x7FFFFFFF)
    for option, place, scale in (("--type", 1, 1), ("--inhibit", 2, 10), ("--timer", 3, 1)):
        with suppress(ValueError):
            expected[option] = (scale * int(rest[rest.index(option) + 1]), after.parameters[place])
    if moved and not after.is_off and (word == "map" or "--cob-id" in rest):
        expected["CAN-ID"] = (True, _is_free((after.cob_id or 0) & 0x3FFFFFFF))
    return "; ".join(f"{name} should be {a}, is {b}" for name, (a, b) in expected.items() if a != b)


def _is_free(can_id: int) -> bool:
    """Whether a PDO may have that identifier (CiA 301, 7.3.5)."""
    restricted = ((0, 0x7F), (0x101, 0x180), (0x581, 0x5FF), (0x601, 0x67F), (0x6E0, 0x6FF), (0x701, 0x7FF))
    if can_id >> 29:
        return True
    return can_id <= 0x7FF and not any(first <= can_id <= last for first, last in restricted)
