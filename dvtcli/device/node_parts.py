"""The parts of a node that functions need: what it is, or what can be read of it; `Node` has all of it.

A function that takes a part cannot write to the node: mypy refuses it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from dvtcli.device.cancellation import Cancellation
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.device.known_pdos import KnownPdos
    from dvtcli.device.nmt_gate import NodeAccess
    from dvtcli.device.observe import RestartCounter
    from dvtcli.device.read_pdos import ReadCache
    from dvtcli.domain.cob_id import CobId
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.ports import CanopenBus, SdoTransport
    from dvtcli.domain.profile import DeviceProfile

T = TypeVar("T")


class NodeDescription(Protocol):
    """What is known of a node from its files; nothing here reads the device."""

    @property
    def node_id(self) -> int:
        """The node-ID (1..127)."""

    @property
    def dictionary(self) -> ObjectDictionary | None:
        """The object dictionary of its EDS; None without an EDS."""

    @property
    def profile(self) -> DeviceProfile:
        """The profile of its family."""

    @property
    def title(self) -> str:
        """The device name from the file, or the family's name."""


class ReadableNode(NodeDescription, Protocol):
    """A node on a bus that is read, not changed, as `KnownPdos` has it."""

    @property
    def bus(self) -> CanopenBus:
        """The bus."""

    @property
    def sdo(self) -> SdoTransport:
        """The SDO channel: each read is a request."""

    @property
    def read_cache(self) -> ReadCache:
        """The reads since the last possible change."""

    @property
    def access(self) -> NodeAccess:
        """The NMT state and the device's reasons for an abort."""

    @property
    def reboot_monitor(self) -> RestartCounter:
        """The monitor of the node's restarts."""

    @property
    def boot_ups_at_contact(self) -> int:
        """The boot-ups at this process's first request."""

    @property
    def last_read(self) -> Mapping[Pdo, PdoConfig]:
        """The PDOs as last read; reads nothing."""

    @property
    def last_seen(self) -> Mapping[Pdo, PdoConfig]:
        """The PDOs as last read or set, of any age; reads nothing."""

    @property
    def cancellation(self) -> Cancellation:
        """The user's Ctrl-C, obeyed at safe points."""

    @property
    def wanted(self) -> Mapping[Pdo, PdoConfig]:
        """The PDOs as this session wants them."""

    @property
    def wanted_values(self) -> Mapping[tuple[int, int], bytes]:
        """The values of single objects as this session wants them."""

    @property
    def unreadable_values(self) -> Mapping[tuple[int, int], bytes]:
        """The values that this session wrote to objects that cannot be read."""

    @property
    def neighbours(self) -> Callable[[], Iterable[KnownPdos]]:
        """The other nodes of the session."""

    def observed(self, look: Callable[[], T]) -> T:
        """See `KnownPdos.observed`."""

    def identity(self) -> Identity:
        """See `KnownPdos.identity`."""

    def upload(self, index: int, sub_index: int) -> bytes:
        """See `KnownPdos.upload`."""

    def known_value(self, index: int, sub_index: int) -> bytes:
        """See `KnownPdos.known_value`."""

    def length_of(self, index: int, sub_index: int) -> int | None:
        """See `KnownPdos.length_of`."""

    def present(self) -> list[Pdo]:
        """See `KnownPdos.present`."""

    def present_known(self) -> list[Pdo]:
        """See `KnownPdos.present_known`."""

    def pdos(self) -> dict[Pdo, PdoConfig]:
        """See `KnownPdos.pdos`."""

    def pdo(self, pdo: Pdo) -> PdoConfig:
        """See `KnownPdos.pdo`."""

    def known_enabled_pdos(self) -> Mapping[Pdo, PdoConfig]:
        """See `KnownPdos.known_enabled_pdos`."""

    def known_pdos(self) -> Mapping[Pdo, PdoConfig]:
        """See `KnownPdos.known_pdos`."""

    def known_pdo(self, pdo: Pdo) -> PdoConfig:
        """See `KnownPdos.known_pdo`."""

    def known_cob_ids(self) -> Mapping[Pdo, CobId]:
        """See `KnownPdos.known_cob_ids`."""

    def read_anew(self) -> None:
        """See `KnownPdos.read_anew`."""

    def is_dynamic(self, pdo: Pdo) -> bool:
        """See `KnownPdos.is_dynamic`."""
