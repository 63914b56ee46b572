"""A node on a bus that is read: SDO channel, NMT state and gate, identity, and its PDOs as read or set.

Writes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

from dvtcli.device.cancellation import Cancellation
from dvtcli.device.nmt_gate import Gate, NodeAccess
from dvtcli.device.observe import RestartCounter, observed
from dvtcli.device.quirks import in_standard_order
from dvtcli.device.read_pdos import UNREADABLE, WHATEVER, ReadCache, present_pdos, read_cob_id, read_optional, read_pdo
from dvtcli.device.store.pending import BootSnapshot
from dvtcli.domain.abort import Abort
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.objects import IDENTITY
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.ports import CanopenBus, SdoReader, SdoTransport
from dvtcli.domain.profile import GENERIC, DeviceProfile
from dvtcli.errors import BusUnavailable, SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.change.plan_document import Identity


@dataclass(frozen=True, slots=True)
class ReadProgress:
    """*node* is asked for an object after *done* of *total* PDOs, if all PDOs are read (else 0 of 0)."""

    node: int
    index: int
    sub_index: int
    done: int
    total: int


T = TypeVar("T")
#: all pauses between tries of COB-IDs that are refused for a moment, and one of them (s)
PASSING_S, _AGAIN_S = 0.5, 0.1


@dataclass(slots=True, init=False, eq=False, repr=False)
class KnownPdos:
    """A node on a bus, with its dictionary (None without an EDS), its profile, and its PDOs as read or set.

    *cancellation* stops a change at a safe point; *consent* is asked before the node leaves OPERATIONAL.
    """

    bus: CanopenBus
    node_id: int
    dictionary: ObjectDictionary | None = None
    profile: DeviceProfile = GENERIC
    cancellation: Cancellation = field(default_factory=Cancellation)
    consent: Callable[[str], None] = lambda _question: None
    #: called with every object read ahead of a change or for a list
    on_look: Callable[[ReadProgress], None] = lambda _looking: None
    #: its boot-ups (`bus.boot_ups`) at this process's first request
    boot_ups_at_contact: int = 0
    #: as *consent*, for an action no earlier question named, even within an agreed change
    consent_anew: Callable[[str], None] = lambda _question: None
    #: unexpected restarts (`bus.restarts`) at the time the reads became valid
    restarts_at_read: int | None = None
    _gate: Gate | None = field(default=None, init=False)
    #: PDOs read, and their total, while all are read
    _looked: tuple[int, int] = field(default=(0, 0), init=False)
    #: reads since the last possible change
    read_cache: ReadCache = field(init=False)
    #: the wanted PDOs of this session's changes, for `verify`
    wanted: dict[Pdo, PdoConfig] = field(default_factory=dict)
    #: the requested parameters of each; the others stayed unchanged
    requested: dict[Pdo, frozenset[str]] = field(default_factory=dict)
    #: the wanted values of readable single objects outside PDOs
    wanted_values: dict[tuple[int, int], bytes] = field(default_factory=dict)
    #: values written by this session to unreadable single objects
    unreadable_values: dict[tuple[int, int], bytes] = field(default_factory=dict)
    #: true if the node is known to have no 0x1020
    has_no_stamp: bool = False
    #: the boot values, for `store --if-changed`
    boot_snapshot: BootSnapshot = field(default_factory=BootSnapshot)
    #: the other nodes of this session
    neighbours: Callable[[], Iterable[KnownPdos]] = tuple
    #: the COB-IDs of all its TPDOs as last read for another node, and the boot-ups at that time
    sent: tuple[int, Mapping[Pdo, CobId]] | None = field(default=None, init=False)
    _pdos: dict[Pdo, PdoConfig] = field(default_factory=dict, init=False)
    _shown: dict[Pdo, PdoConfig] = field(default_factory=dict, init=False)
    _present: list[Pdo] | None = field(default=None, init=False)
    #: the PDOs, and all COB-IDs, made from the read cache, each with the cache's `expired()` at that time
    _made: dict[tuple[Pdo, bool], tuple[int, PdoConfig]] = field(default_factory=dict, init=False)
    _made_cob_ids: tuple[int, Mapping[Pdo, CobId]] | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self.read_cache = ReadCache(self.bus, self.node_id, lambda: self.sdo, self._looks)

    def _looks(self, index: int, sub_index: int) -> None:
        self.on_look(ReadProgress(self.node_id, index, sub_index, *self._looked))

    @property
    def sdo(self) -> SdoTransport:
        """The node's SDO channel."""
        return in_standard_order(self.bus.sdo(self.node_id), self.profile)

    @property
    def reboot_monitor(self) -> RestartCounter:
        """The monitor of the node's restarts."""
        return RestartCounter(self.bus, self.node_id)

    def observed(self, look: Callable[[], T]) -> T:
        """The result of *look*, read without a restart between. Raises NoAnswer after repeated restarts."""
        return observed(self.reboot_monitor, look, self.node_id)

    @property
    def access(self) -> NodeAccess:
        """The node's NMT state and abort reasons."""
        return NodeAccess(self.bus, self.node_id, self.profile)

    @property
    def gate(self) -> Gate:
        """The node's pre-operational gate; the same gate as long as the caller keeps it open."""
        if self._gate is None:
            self._gate = Gate(self.access, self._ask)
        return self._gate

    def _ask(self, question: str) -> None:
        """Ask through the *consent* of the moment: a script's lines may carry their own --yes."""
        self.consent(question)

    @property
    def title(self) -> str:
        """The device name from the file, or the family's name."""
        return (self.dictionary.info.product_name if self.dictionary else "") or self.profile.title

    def identity(self) -> Identity:
        """The node's identity (0x1018), read once per line: at a prompt the device may have been replaced."""
        names = {"vendor": 1, "product": 2, "revision": 3, "serial": 4}
        look = self.read_cache.look()
        return {name: read_optional(look, IDENTITY, sub_index, 4) for name, sub_index in names.items()}

    def upload(self, index: int, sub_index: int) -> bytes:
        """Read one object; an abort for a missing sub-index gets the hint that sub-indices are hexadecimal."""
        self.read_cache.forget_one(index, sub_index)
        return self.known_value(index, sub_index)

    def known_value(self, index: int, sub_index: int) -> bytes:
        """One object, from the cache if nothing could have changed it since."""
        try:
            return self.read_cache.upload(index, sub_index)
        except SdoAborted as aborted:
            self.access.explain(aborted)
            aborted.hint = hint_for_missing(aborted, self.dictionary) or aborted.hint
            raise

    def length_of(self, index: int, sub_index: int) -> int | None:
        """An object's length in bits from the EDS, else from an upload; None if unknown."""
        entry = self.dictionary.entry(index, sub_index) if self.dictionary else None
        if entry is not None and entry.bits is not None:
            return entry.bits
        try:
            return 8 * len(self.read_cache.upload(index, sub_index))
        except SdoAborted:
            return None

    def describe(self, dictionary: ObjectDictionary | None) -> None:
        """Set the node's *dictionary*, unknown or different when the node was opened; None for none."""
        self.dictionary, self._present, self._made_cob_ids = dictionary, None, None

    def present(self) -> list[Pdo]:
        """The PDOs of the node, TPDOs first."""
        if self._present is None:
            self._present = present_pdos(self.read_cache, self.dictionary)
        return self._present

    def pdos(self) -> dict[Pdo, PdoConfig]:
        """Read every PDO of the device, repeated after a restart; PDOs listed in the EDS but missing are left out.

        A PDO with an unreadable parameter is included and marked inconsistent.
        """
        self.read_cache.forget()
        return dict(self.known_pdos())

    def known_pdos(self) -> Mapping[Pdo, PdoConfig]:
        """Every PDO, from the cache if nothing could have changed it since."""
        boot_ups = self.bus.boot_ups(self.node_id)
        self._pdos = self.observed(self._read_pdos)
        self._shown = dict(self._pdos)
        if self.bus.boot_ups(self.node_id) == boot_ups:
            self.boot_snapshot.read(boot_ups, self._pdos)
        return self._pdos

    def _read_pdos(self) -> dict[Pdo, PdoConfig]:
        look = self.read_cache.look()
        return self._of_present(lambda pdo: self._read_pdo(look, pdo, WHATEVER))

    def _read_pdo(self, look: SdoReader, pdo: Pdo, passing: Container[int] = UNREADABLE) -> PdoConfig:
        """As `read_pdo` by a *look* at the cache, put together once for the values in it."""
        expired, key = self.read_cache.expired(), (pdo, passing is WHATEVER)
        made = self._made.get(key)
        if made is not None and made[0] == expired:
            return made[1]
        config = read_pdo(look, pdo, passing)
        self._made[key] = expired, config
        return config

    def _of_present(self, read: Callable[[Pdo], T]) -> dict[Pdo, T]:
        """The result of *read* for each PDO, without PDOs missing in the node."""
        found: dict[Pdo, T] = {}
        present = self.present()
        try:
            for number, pdo in enumerate(present):
                self._looked = number, len(present)
                with suppress(SdoAborted):  # neither COB-ID nor mapping: no such PDO
                    found[pdo] = read(pdo)
        finally:
            self._looked = 0, 0
        return found

    def known_enabled_pdos(self) -> Mapping[Pdo, PdoConfig]:
        """Every enabled PDO, as `known_pdos` has it."""
        return self.observed(self._read_enabled)

    def _read_enabled(self) -> dict[Pdo, PdoConfig]:
        cob_ids, look = self.known_cob_ids(), self.read_cache.look()
        return {pdo: self._read_pdo(look, pdo, WHATEVER) for pdo, cob_id in cob_ids.items() if cob_id.valid}

    def pdo(self, pdo: Pdo) -> PdoConfig:
        """Read one PDO. Raises UsageError if the node has no such PDO."""
        self.read_cache.forget_objects((pdo.communication_index, pdo.mapping_index))
        return self.known_pdo(pdo)

    def known_pdo(self, pdo: Pdo) -> PdoConfig:
        """One PDO, from the cache if nothing could have changed it since."""
        try:
            config = self.observed(lambda: self._read_pdo(self.read_cache.look(), pdo))
        except SdoAborted as aborted:
            raise no_pdo(self.node_id, pdo, self.present(), aborted) from aborted
        self._pdos[pdo] = self._shown[pdo] = config
        return config

    def known_cob_ids(self) -> Mapping[Pdo, CobId]:
        """The COB-ID of every PDO, from the cache if nothing could have changed it since.

        A temporary refusal is retried, after pauses of `PASSING_S` in all.
        """
        return self.observed(self._read_cob_ids)

    def _read_cob_ids(self) -> Mapping[Pdo, CobId]:
        pauses, look = iter([_AGAIN_S] * round(PASSING_S / _AGAIN_S)), self.read_cache.look()
        expired = self.read_cache.expired()
        if self._made_cob_ids is None or self._made_cob_ids[0] != expired:
            self._made_cob_ids = expired, self._of_present(lambda pdo: self._cob_id(look, pdo, pauses))
        return self._made_cob_ids[1]

    def _cob_id(self, look: SdoReader, pdo: Pdo, pauses: Iterator[float]) -> CobId:
        """The COB-ID of *pdo*, after a temporary refusal asked for again as long as there are *pauses*."""
        while True:
            try:
                return read_cob_id(look, pdo)
            except SdoAborted as aborted:
                if aborted.code in UNREADABLE:
                    raise
                self.read_cache.forget_one(pdo.communication_index, 1)  # nor is anything made of the refusal kept
                pause_s = next(pauses, None)
                if pause_s is None:
                    raise
            self.bus.sleep(pause_s)
            look = self.read_cache.look()

    @property
    def last_read(self) -> Mapping[Pdo, PdoConfig]:
        """The PDOs as last read; reads nothing."""
        return self._pdos

    @property
    def last_seen(self) -> Mapping[Pdo, PdoConfig]:
        """The PDOs as last read or set, of any age, for display only; reads nothing."""
        return self._shown

    def present_known(self) -> list[Pdo]:
        """The PDOs known without a read: from the EDS, or read before."""
        return self._present or list(self._shown)

    def tpdos_known(self) -> list[PdoConfig]:
        """The TPDOs as last set or read by this session; reads nothing."""
        return [config for pdo, config in {**self._pdos, **self.wanted}.items() if pdo.is_tpdo]

    def is_dynamic(self, pdo: Pdo) -> bool:
        """True if the EDS allows changes to the mapping of *pdo*, or no EDS is known."""
        entry = self.dictionary.entry(pdo.mapping_index, 0) if self.dictionary else None
        return entry is None or entry.access.writable

    def read_anew(self) -> None:
        """Expire the read cache: the next request reads the node."""
        self._pdos.clear()
        self.read_cache.forget()

    def mark_unknown(self) -> None:
        """Discard all known values after an unknown change: nothing is displayed until the next read."""
        self.read_anew()
        self._shown.clear()

    def forget(self) -> None:
        """Drop all reads: the device was written, or its values may have changed."""
        self.read_anew()
        try:
            boot_ups = self.bus.boot_ups(self.node_id)
        except BusUnavailable:  # a dead bus stays dead: nothing will be stored over it
            boot_ups = self.boot_snapshot.boot_ups
        self.boot_snapshot.wrote(boot_ups)

    def commanded(self) -> None:
        """After a manual NMT command: forget the gate's state and expire reads."""
        self._gate = None
        self.read_anew()


def no_pdo(node_id: int, pdo: Pdo, present: Iterable[Pdo], aborted: SdoAborted) -> SdoAborted:
    """The error for *pdo*, unreadable (*aborted*) in node *node_id*, with the *present* PDOs in words.

    *present* may come from the file: a missing object is reported as such.
    """
    same = [other for other in present if other.direction is pdo.direction]
    if pdo in same:
        if aborted.code in (Abort.NO_OBJECT, Abort.NO_SUB_INDEX):
            aborted.text = f"node {node_id} has no {pdo.label}, though its EDS or DCF lists it: {aborted.text}"
            aborted.node = node_id
            aborted.hint = Hint(
                Action.SHOW_NODE,
                {"node": node_id},
                f"the file may be of another revision, which {{}} shows; leave {pdo.label} out",
            ) + Hint(Action.GIVE_EDS, why=", or {}")
        return aborted
    have = (
        f"it has {same[0] if len(same) == 1 else f'{same[0]}…{same[-1]}'}"
        if same
        else f"it has no {pdo.direction.upper()}s"
    )
    aborted.text, aborted.node = f"node {node_id} has no {pdo.label}: {have}", node_id
    aborted.args = (aborted.text,)
    aborted.hint = Hint(Action.SHOW_PDOS, {"all": True}, "lists its PDOs")
    return aborted


def hint_for_missing(aborted: SdoAborted, dictionary: ObjectDictionary | None) -> Hint | str | None:
    """What to try after an upload of a missing object; None for other refusals."""
    if aborted.code == Abort.NO_SUB_INDEX and dictionary is not None:
        from dvtcli.domain.rules.mapped_object import decimal_hint

        return decimal_hint(dictionary, aborted.index, aborted.sub_index)
    if aborted.code == Abort.NO_OBJECT:
        find = Hint(Action.FIND_OBJECTS, why="searches the dictionary")
        return find if dictionary else Hint(Action.GIVE_EDS, why="names its objects")
    return None
