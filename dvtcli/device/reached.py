"""The connection to one node: SDO channel, NMT state and gate, and identity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

from dvtcli.device.cancellation import Cancellation
from dvtcli.device.nmt_gate import Gate, NodeAccess
from dvtcli.device.observe import BusWitness, observed
from dvtcli.device.quirks.standard_channel import in_standard_order
from dvtcli.device.read_cache import ReadCache
from dvtcli.device.read_pdos import IDENTITY, read_optional
from dvtcli.device.read_progress import ReadProgress
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.ports import CanopenBus, SdoTransport
from dvtcli.domain.profile import GENERIC, DeviceProfile
from dvtcli.errors import SdoAborted

if TYPE_CHECKING:
    from dvtcli.device.change.plan_document import Identity

T = TypeVar("T")


@dataclass(slots=True)
class Reached:
    """A node on a bus, with its dictionary (None without an EDS) and profile.

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
    memory: ReadCache = field(init=False)

    def __post_init__(self) -> None:
        self.memory = ReadCache(self.bus, self.node_id, lambda: self.sdo, self._looks)

    def _looks(self, index: int, sub_index: int) -> None:
        self.on_look(ReadProgress(self.node_id, index, sub_index, *self._looked))

    @property
    def sdo(self) -> SdoTransport:
        """The node's SDO channel."""
        return in_standard_order(self.bus.sdo(self.node_id), self.profile)

    @property
    def witness(self) -> BusWitness:
        """The monitor of the node's restarts."""
        return BusWitness(self.bus, self.node_id)

    def observed(self, look: Callable[[], T]) -> T:
        """The result of *look*, read without a restart between. Raises NoAnswer after repeated restarts."""
        return observed(self.witness, look, self.node_id)

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
        look = self.memory.look()
        return {name: read_optional(look, IDENTITY, sub_index, 4) for name, sub_index in names.items()}

    def upload(self, index: int, sub_index: int) -> bytes:
        """Read one object; an abort for a missing sub-index gets the hint that sub-indices are hexadecimal."""
        self.memory.forget_one(index, sub_index)
        return self.known_value(index, sub_index)

    def known_value(self, index: int, sub_index: int) -> bytes:
        """One object, from the cache if nothing could have changed it since."""
        try:
            return self.memory.upload(index, sub_index)
        except SdoAborted as aborted:
            from dvtcli.device.missing import hint_for_missing

            self.access.explain(aborted)
            aborted.hint = hint_for_missing(aborted, self.dictionary) or aborted.hint
            raise

    def length_of(self, index: int, sub_index: int) -> int | None:
        """An object's length in bits from the EDS, else from an upload; None if unknown."""
        entry = self.dictionary.entry(index, sub_index) if self.dictionary else None
        if entry is not None and entry.bits is not None:
            return entry.bits
        try:
            return 8 * len(self.memory.upload(index, sub_index))
        except SdoAborted:
            return None
