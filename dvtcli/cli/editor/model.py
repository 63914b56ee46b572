"""What the editor edits: a node's PDOs with undo and redo, and objects that may be mapped. Pure."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

from dvtcli.domain.cob_id import HIGHEST_BASE_CAN_ID, CobId
from dvtcli.domain.object_dictionary import normalised
from dvtcli.domain.object_syntax import parse_cob_id
from dvtcli.domain.pdo import (
    MAX_PDO_BITS,
    PdoCommunicationParameter,
    PdoConfig,
    PdoMappingEntry,
    transmission_type_text,
)
from dvtcli.domain.rules.mapped_object import is_taken
from dvtcli.domain.text import join_some

if TYPE_CHECKING:
    from dvtcli.domain.object_dictionary import ObjectDictionary, OdEntry
    from dvtcli.domain.object_scalings import ObjectScalings
    from dvtcli.domain.pdo import Pdo
    from dvtcli.domain.profile import DeviceProfile

T = TypeVar("T")
#: steps that can be undone
_STEPS = 200
#: highest values of the parameters
_WORD, _BYTE = 0xFFFF, 0xFF
#: highest SYNC start value (CiA 301, 7.5.2.37)
_SYNC_START = 240
#: steps of the inhibit time in a millisecond
INHIBIT_PER_MS = 10
#: of a number of steps, what a float may lack
_ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class Parameter:
    """A communication parameter that is edited as text; *help* says what may be entered."""

    name: str
    text: Callable[[Pdo, PdoConfig], str]
    set: Callable[[PdoConfig, str], PdoConfig]
    help: str


def _cob_id_text(_pdo: Pdo, config: PdoConfig) -> str:
    return str(config.communication.cob_id)


def _set_cob_id(config: PdoConfig, text: str) -> PdoConfig:
    """Set the CAN-ID; it has 29 bits if it is higher than 0x7FF, or written with more than three digits."""
    cob_id, held = parse_cob_id(text), config.communication.cob_id
    extended = cob_id > HIGHEST_BASE_CAN_ID or len(text) > len("0x7FF")
    return config.with_parameters(cob_id=CobId(cob_id, held.valid, held.rtr_allowed, extended))


def _type_text(pdo: Pdo, config: PdoConfig) -> str:
    kind = config.communication.transmission_type
    return "" if kind is None else f"{kind}  {transmission_type_text(kind, pdo.direction)}"


def _number(text: str, most: int) -> int:
    """Return *text*, decimal or hexadecimal with 0x; raises ValueError unless it is within 0 and *most*."""
    number = text.lower()
    try:
        value = int(number.removeprefix("0x"), 16 if number.startswith("0x") else 10)
    except ValueError:
        value = -1
    if not 0 <= value <= most:
        raise ValueError(f"{_typed(text)} is not a number from 0 to {most}")
    return value


def _time(text: str, scale: int = 1) -> int:
    """Return *text*, a time in ms, times *scale*; raises ValueError unless it fits 16 bits."""
    try:
        value = float(text.lower().removesuffix("ms")) * scale
    except ValueError:
        value = -1.0
    if not 0 <= value <= _WORD or abs(value - round(value)) > _ROUNDING:
        steps = f" in steps of {1 / scale:g} ms" if scale > 1 else ""
        raise ValueError(f"{_typed(text)} is not a time from 0 to {_WORD / scale:g} ms{steps}")
    return round(value)


def _typed(text: str) -> str:
    return f"'{text}'" if text else "nothing"


COB_ID = "COB-ID"
PARAMETERS = (
    Parameter(COB_ID, _cob_id_text, _set_cob_id, "a CAN-ID as 0x181; auto: that of the pre-defined connection set"),
    Parameter(
        "type",
        _type_text,
        lambda config, text: config.with_parameters(transmission_type=_number(text, _BYTE)),
        "0: acyclic, synchronous; 1…240: every N-th SYNC; 254, 255: event-driven",
    ),
    Parameter(
        "inhibit time",
        lambda _pdo, config: _text(config.communication.inhibit_time, " ms", INHIBIT_PER_MS),
        lambda config, text: config.with_parameters(inhibit_time=_time(text, INHIBIT_PER_MS)),
        "minimum time between two frames in ms, in steps of 0.1; 0: none",
    ),
    Parameter(
        "event timer",
        lambda _pdo, config: _text(config.communication.event_timer, " ms"),
        lambda config, text: config.with_parameters(event_timer=_time(text)),
        "ms; a TPDO is sent at least so often; 0: off",
    ),
    Parameter(
        "SYNC start",
        lambda _pdo, config: _text(config.communication.sync_start_value, ""),
        lambda config, text: config.with_parameters(sync_start_value=_number(text, _SYNC_START)),
        "value of the SYNC counter at which the PDO begins, 1…240; 0: any",
    ),
)


def _text(value: int | None, unit: str, scale: int = 1) -> str:
    return "not there" if value is None else f"{value / scale:g}{unit}"


def _merged(before: PdoConfig, edited: PdoConfig, held: PdoConfig) -> tuple[PdoConfig, list[str]]:
    """Return *held* with what *edited* has otherwise than *before*, and the names of what *held* has otherwise, too."""
    twice: list[str] = []

    def chosen(name: str, of: Callable[[PdoConfig], T]) -> T:
        was, mine, theirs = of(before), of(edited), of(held)
        if mine == was:
            return theirs
        if theirs not in (was, mine):
            twice.append(name)
        return mine

    can_id, extended = chosen(COB_ID, lambda pdo: (pdo.communication.cob_id.can_id, pdo.communication.cob_id.extended))
    cob_id = CobId(can_id, chosen("on/off", lambda pdo: pdo.enabled), held.communication.cob_id.rtr_allowed, extended)
    communication = PdoCommunicationParameter(
        cob_id,
        chosen("type", lambda pdo: pdo.communication.transmission_type),
        chosen("inhibit time", lambda pdo: pdo.communication.inhibit_time),
        chosen("event timer", lambda pdo: pdo.communication.event_timer),
        chosen("SYNC start", lambda pdo: pdo.communication.sync_start_value),
    )
    mapping, mpdo, multiplexed = chosen("mapping", lambda pdo: (pdo.mapping, pdo.mpdo, pdo.multiplexed))
    return replace(held, communication=communication, mapping=mapping, mpdo=mpdo, multiplexed=multiplexed), twice


class EditedPdos:
    """The PDOs as the node *held* them, and as they are edited."""

    def __init__(self, held: Mapping[Pdo, PdoConfig]) -> None:
        self.held = dict(held)
        self.now = dict(held)
        self._undo: list[dict[Pdo, PdoConfig]] = []
        self._redo: list[dict[Pdo, PdoConfig]] = []

    def changed(self) -> dict[Pdo, PdoConfig]:
        """Return the PDOs that differ from what the node holds."""
        return {pdo: config for pdo, config in self.now.items() if config != self.held.get(pdo)}

    def put(self, pdo: Pdo, config: PdoConfig) -> None:
        """Let *pdo* be *config* from now on."""
        if config != self.now[pdo]:
            self._undo = [*self._undo[-_STEPS:], dict(self.now)]
            self._redo.clear()
            self.now[pdo] = config

    def undo(self) -> bool:
        """Take the last step back; False if there is none."""
        return self._step(self._undo, self._redo)

    def redo(self) -> bool:
        """Make the last undone step again; False if there is none."""
        return self._step(self._redo, self._undo)

    def _step(self, from_: list[dict[Pdo, PdoConfig]], to: list[dict[Pdo, PdoConfig]]) -> bool:
        if not from_:
            return False
        to.append(dict(self.now))
        self.now = from_.pop()
        return True

    def read_again(self, held: Mapping[Pdo, PdoConfig]) -> str:
        """Take what the node holds now, except what was edited; returns what is missing, or was changed twice."""
        notes = [f"{pdo.label} no longer exists; its old values are shown" for pdo in self.held if pdo not in held]
        now = {**self.now, **held}
        for pdo, edited in self.changed().items():
            if pdo in held:
                now[pdo], twice = _merged(self.held[pdo], edited, held[pdo])
                if twice:
                    notes.append(f"{pdo.label}: {join_some(twice)} changed on the node, too; yours stays")
        if {**self.held, **held} != self.held:  # else each step can still be undone
            self._undo.clear()
            self._redo.clear()
        self.held, self.now = {**self.held, **held}, now
        return "; ".join(notes)

    def insert(self, pdo: Pdo, at: int, *entries: PdoMappingEntry) -> None:
        """Map *entries* in front of the entry number *at*, in one step."""
        mapping = self.now[pdo].mapping
        self._map(pdo, (*mapping[:at], *entries, *mapping[at:]))

    def replace(self, pdo: Pdo, at: int, entry: PdoMappingEntry) -> None:
        """Map *entry* instead of the entry number *at*."""
        mapping = self.now[pdo].mapping
        self._map(pdo, (*mapping[:at], entry, *mapping[at + 1 :]))

    def remove(self, pdo: Pdo, at: int) -> None:
        """Map the entry number *at* no more."""
        mapping = self.now[pdo].mapping
        self._map(pdo, (*mapping[:at], *mapping[at + 1 :]))

    def move(self, pdo: Pdo, at: int, step: int) -> int:
        """Exchange the entry number *at* with its neighbour, *step* -1 or 1; returns its new number."""
        mapping, to = list(self.now[pdo].mapping), at + step
        if not 0 <= to < len(mapping):
            return at
        mapping[at], mapping[to] = mapping[to], mapping[at]
        self._map(pdo, tuple(mapping))
        return to

    def _map(self, pdo: Pdo, mapping: tuple[PdoMappingEntry, ...]) -> None:
        self.put(pdo, replace(self.now[pdo], mapping=mapping))

    def switch(self, pdo: Pdo) -> None:
        """Enable *pdo* if it is disabled, else disable it."""
        config = self.now[pdo]
        self.put(pdo, config.with_parameters(cob_id=replace(config.communication.cob_id, valid=not config.enabled)))

    def bits_left(self, pdo: Pdo) -> int:
        """Return the free bits of the frame."""
        return max(0, MAX_PDO_BITS - self.now[pdo].bits)


#: a sub-index of one digit
_SHORT_SUB = re.compile(r"^([0-9a-f]{4}):([0-9a-f])$")


@dataclass(frozen=True, slots=True)
class MappableRow:
    """An object with its name and its unit; *search* is what the filter looks at, *taken* by direction of a PDO."""

    entry: OdEntry
    name: str
    unit: str
    search: str
    taken: tuple[bool, bool]


@dataclass(frozen=True, slots=True)
class Offer:
    """An object in the list, and why it does not fit; empty if it does. One that *is_too_long* can be mapped."""

    listed: MappableRow
    reason: str = ""
    is_too_long: bool = False


class ObjectList:
    """All objects of *dictionary*, looked at once."""

    def __init__(self, dictionary: ObjectDictionary | None, profile: DeviceProfile, scalings: ObjectScalings) -> None:
        self._listed: list[MappableRow] = []
        if dictionary is not None:
            self._listed = [_listed(dictionary, profile, scalings, entry) for entry in dictionary.entries()]
        #: each object, its offer if it can be mapped, and if it cannot, into an RPDO and into a TPDO
        self._offers = [(listed, Offer(listed), (_refused(listed, 0), _refused(listed, 1))) for listed in self._listed]
        self._last: tuple[tuple[str, bool, int], list[Offer]] | None = None

    def offers(self, text: str, *, tpdo: bool, bits_left: int) -> list[Offer]:
        """Return the objects with *text* in number, name or unit: those that fit first, then the others."""
        asked = text, tpdo, bits_left
        if self._last is None or self._last[0] != asked:
            self._last = asked, self._found(*asked)
        return self._last[1]

    def _found(self, text: str, tpdo: bool, bits_left: int) -> list[Offer]:
        wanted = normalised(_SHORT_SUB.sub(r"\1:0\2", text.lower().removeprefix("0x")))
        word = f" {wanted}"
        numbers, names, others, too_long, refused = [list[Offer]() for _ in range(5)]
        for listed, offer, refusals in self._offers:
            search = listed.search
            if wanted and wanted not in search:
                continue
            if not listed.taken[tpdo]:
                refused.append(refusals[tpdo])
            elif (listed.entry.bits or 1) > bits_left:
                too_long.append(Offer(listed, "too long", is_too_long=True))
            elif search.startswith(wanted):
                numbers.append(offer)
            else:
                (names if word in search else others).append(offer)
        return [*numbers, *names, *others, *too_long, *refused]


def _listed(
    dictionary: ObjectDictionary, profile: DeviceProfile, scalings: ObjectScalings, entry: OdEntry
) -> MappableRow:
    name = dictionary.display_name(entry.index, entry.sub_index)
    unit = scalings.of(entry.index, entry.sub_index).unit
    search = f"{normalised(entry.object)} {normalised(name)} {unit.lower()}"
    rpdo, tpdo = (is_taken(profile, dictionary, entry, tpdo=way) for way in (False, True))
    return MappableRow(entry, name, unit, search, (rpdo, tpdo))


def _refused(listed: MappableRow, tpdo: int) -> Offer:
    other = "RPDO only" if tpdo else "TPDO only"
    return Offer(listed, other if listed.taken[not tpdo] else "not mappable")
