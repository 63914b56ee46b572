"""Findings of rules, and their subject: the `Proposal`, or a line of a text file."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.hint import Hint
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.profile import DeviceProfile, Severity

ERROR = (Severity.ERROR,)
WARNING = (Severity.WARNING,)
NOTE = (Severity.NOTE,)


class Rule(NamedTuple):
    """A rule: *name*, severities, condition (*sense*), and *source*.

    *aborts* are a device's SDO abort codes for a violation. Strongest severity first.
    """

    name: str
    severities: tuple[Severity, ...]
    sense: str
    source: str
    aborts: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Finding:
    """A finding of a rule.

    *rule* is its short name, *place* an object (`0x1A00:03`) or `FILE:LINE`, *abort* the SDO abort code the
    device would give, or None. *complaint* is its cause's place in a file, None without a file.
    """

    rule: str
    severity: Severity
    place: str
    text: str
    abort: int | None = None
    hint: Hint | str | None = None
    complaint: FileComplaint | None = field(default=None, compare=False)

    @property
    def pdo(self) -> Pdo | None:
        """The PDO at the finding's place, or at the end of a link (`5:rpdo2`); None for none."""
        head, _, tail = self.place.partition(":")
        if head.startswith("0x"):
            return Pdo.at(int(head, 16))
        return Pdo.parse(tail) if head.isdecimal() and tail[1:4] == "pdo" else None


class Producer(NamedTuple):
    """An enabled TPDO of another node."""

    node_id: int
    pdo: Pdo
    cob_id: CobId


@dataclass(frozen=True, slots=True)
class Proposal:
    """A PDO's present and requested configuration, with all data for the rules.

    *others* are the node's other PDOs in their final state, and *cob_ids* their COB-IDs if known without the rest
    (None: use *others*); *dictionary* is None without an EDS; *lengths* are object lengths in bits learnt by reading
    the device; *services* returns the services' CAN-IDs, and whether they have 29 bits, each with its use: SYNC, the
    node's EMCY, all known nodes' further SDO channels (empty: the standard's defaults); *elsewhere* returns the other
    known nodes' TPDOs, all or those with the wanted CAN-ID; *absent* has the device's abort codes for uploads of
    missing objects; *unread* returns the node-IDs of nodes that were received and not read.
    """

    node_id: int
    pdo: Pdo
    now: PdoConfig
    want: PdoConfig
    others: Mapping[Pdo, PdoConfig]
    profile: DeviceProfile
    dictionary: ObjectDictionary | None = None
    lengths: Mapping[tuple[int, int], int] = field(default_factory=dict)
    services: Callable[[], Mapping[tuple[int, bool], str]] = dict
    elsewhere: Callable[[], Collection[Producer]] = tuple
    cob_ids: Mapping[Pdo, CobId] | None = None
    absent: Mapping[tuple[int, int], int] = field(default_factory=dict)
    unread: Callable[[], Collection[int]] = tuple

    @property
    def other_cob_ids(self) -> Mapping[Pdo, CobId]:
        """The COB-IDs of the node's other PDOs in their final state."""
        if self.cob_ids is not None:
            return self.cob_ids
        return {pdo: config.communication.cob_id for pdo, config in self.others.items()}

    def name(self, index: int, sub_index: int) -> str:
        """The object with its name if known: `6041:00 "Statusword"`."""
        known = self.dictionary.display_name(index, sub_index) if self.dictionary else ""
        return f'{index:04X}:{sub_index:02X} "{known}"' if known else f"{index:04X}:{sub_index:02X}"

    def communication_place(self, sub_index: int) -> str:
        """A communication sub-index for a person: `0x1800:03`."""
        return f"0x{self.pdo.communication_index:04X}:{sub_index:02X}"

    def mapping_place(self, sub_index: int) -> str:
        """A mapping sub-index for a person: `0x1A00:03`."""
        return f"0x{self.pdo.mapping_index:04X}:{sub_index:02X}"


def finding_of(rule: str, severity: Severity, place: str, text: str, hint: str | None = None) -> Finding:
    """A finding of a rule declared elsewhere, such as a network rule."""
    return Finding(rule, severity, place, text, hint=hint)


def error(rule: str, place: str, text: str, abort: int | None = None, hint: Hint | str | None = None) -> Finding:
    """A finding that stops the change unless forced."""
    return Finding(rule, Severity.ERROR, place, text, abort, hint)


def warning(rule: str, place: str, text: str, hint: Hint | str | None = None) -> Finding:
    """A finding that is shown and stops nothing."""
    return Finding(rule, Severity.WARNING, place, text, None, hint)


def note(rule: str, place: str, text: str, hint: Hint | None = None) -> Finding:
    """A finding that only explains."""
    return Finding(rule, Severity.NOTE, place, text, None, hint)


def disabled_and_empty(config: PdoConfig) -> PdoConfig:
    """The same PDO disabled and empty, with another transmission type: rules check changes only."""
    held = config.communication
    kind = None if held.transmission_type is None else held.transmission_type ^ 1
    return PdoConfig(replace(held, cob_id=held.cob_id.disabled(), transmission_type=kind), ())


@dataclass(frozen=True, slots=True, order=True)
class FileComplaint:
    """An error in *line* at *column* (1 and up) of *file*, *width* characters long.

    *source* is the text of the line, *before* the text of the line above, empty for none.
    """

    file: str
    line: int
    column: int
    text: str
    width: int = 1
    source: str = ""
    before: str = ""

    @property
    def place(self) -> str:
        """`FILE:LINE:COLUMN`."""
        return f"{self.file}:{self.line}:{self.column}"
