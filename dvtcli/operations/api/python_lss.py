"""LSS for a program, like `dvtcli lss`, on an open bus. Prints nothing and asks nobody."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvtcli.operations.api.calls import Calls
from dvtcli.operations.api.checks import flags, number, path, whole, wrong

if TYPE_CHECKING:
    from dvtcli.domain.lss_services import LssAddress, LssRanges
    from dvtcli.operations.results.lss_nodes import LssBitRate, LssChanged, LssFound


class Lss:
    """An LSS master (CiA 305) on a bus; made by `Bus.lss`.

    An *address* is an LssAddress, as a scan finds it, or vendor-ID, product code, revision and serial number.
    """

    def __init__(self, calls: Calls) -> None:
        self._calls = calls

    def __repr__(self) -> str:
        return f"<dvtcli LSS master of bus {self._calls.session.bus.name}>"

    def scan(self, wait_s: float = 0.05) -> LssFound:
        """Find every node without node-ID by fast scan; *wait_s* (0.005…2) is the time-out of a request in s.

        True if there are any, in `nodes`. Raises NoAnswer for contradicting answers.
        """
        from dvtcli.operations.lss.lss_find import lss_scan

        number("wait_s", wait_s, "a number of seconds, 0.005…2", low=0.005, high=2)
        return self._calls.run(lambda: lss_scan(self._calls.session, wait_s))

    def identify(self, address: LssAddress | tuple[Any, Any, Any, Any] | None = None) -> LssFound:
        """Ask for a node with *address*; None: count nodes without node-ID that answer (`answered`).

        Revision and serial number may be pairs, lowest and highest: `within` then says whether such a node exists.
        """
        from dvtcli.operations.lss.lss_find import lss_identify

        wanted = None if address is None else _address_or_ranges(address)
        return self._calls.run(lambda: lss_identify(self._calls.session, wanted))

    def select(self, who: LssAddress | tuple[int, int, int, int] | int) -> LssFound:
        """Select the single node with this address or node-ID (1…127) for configuration: `node_id` uses it.

        Raises NoAnswer if no node has it, DeviceRefused if several have.
        """
        from dvtcli.operations.lss.lss_find import lss_select

        one = whole("who", who, "a node-ID", 127, low=1) if isinstance(who, int) else _address(who)
        return self._calls.run(lambda: lss_select(self._calls.session, one))

    def node_id(
        self, node_id: int, address: LssAddress | tuple[int, int, int, int] | None = None, *, yes: bool = False
    ) -> LssChanged:
        """Set *node_id* (1…127) on the node with *address*, None: on the selected node.

        Asks first, unless *yes*. Succeeds once the node is identified by SDO at its new node-ID. Raises SafetyRefusal
        if the node-ID is in use; LeftChanged if the node did not come up and its old node-ID could not be restored.
        """
        from dvtcli.operations.lss.lss_node_id import lss_node_id

        wanted = None if address is None else _address(address)
        whole("node_id", node_id, "a node-ID", 127, low=1)
        return self._calls.run(lambda: lss_node_id(self._calls.session, node_id, wanted), yes=yes)

    def store(self, node_id: int, *, prove: bool = False, yes: bool = False) -> LssChanged:
        """Store the node-ID of the node *node_id*; *prove* then resets and checks it.

        Asks first, unless *yes*. Raises DeviceRefused with its reason, LeftChanged if it returns without its node-ID.
        """
        from dvtcli.operations.lss.lss_node_id import lss_store

        whole("node_id", node_id, "a node-ID", 127, low=1)
        flags(prove=prove)
        return self._calls.run(lambda: lss_store(self._calls.session, node_id, prove=prove), yes=yes)

    def assign(self, file: str | Path, *, store: bool = False, prove: bool = False, yes: bool = False) -> LssChanged:
        """Set the node-IDs of the network *file* on its nodes, found by their identity.

        Asks first, unless *yes*; *store* stores them, once all came up, and *prove* then resets each. `missing` are
        nodes not found. If a node does not come up, all are rolled back.
        """
        from dvtcli.operations.lss.lss_assign import lss_assign

        chosen = str(path("file", file))
        flags(store=store, prove=prove)
        return self._calls.run(lambda: lss_assign(self._calls.session, chosen, stores=store, prove=prove), yes=yes)

    def bit_rate(
        self, bit_rate: int, file: str | Path | None = None, *, store: bool = False, prove: bool = False,
        yes: bool = False,
    ) -> LssBitRate:  # fmt: skip
        """Change the bus and all its nodes to *bit_rate* (bit/s, a standard value).

        *file*: only the nodes of this network may be present. Asks first, unless *yes*; *store* stores it on each node,
        once all are back, and *prove* then resets all and checks them. Raises SafetyRefusal if another node is heard,
        if the bus could not return to its bit rate, or if a drive that may move would be reset. If a node does not come
        back, all are rolled back; raises LeftChanged if this fails.
        """
        from dvtcli.operations.lss.lss_bit_rate import lss_bit_rate

        whole("bit_rate", bit_rate, "a bit rate (bit/s)", 1_000_000, low=10_000)
        chosen = None if file is None else str(path("file", file))
        flags(store=store, prove=prove)
        return self._calls.run(
            lambda: lss_bit_rate(self._calls.session, bit_rate, chosen, stores=store, prove=prove), yes=yes
        )


def _address_or_ranges(told: Any) -> LssAddress | LssRanges:
    from dvtcli.domain.lss_services import LssRanges

    parts = tuple(told) if isinstance(told, tuple | list) else ()
    if len(parts) != 4 or not any(isinstance(part, tuple) for part in parts[2:]):
        return _address(told)
    vendor, product = (whole("address", part, "a number of 32 bits", 0xFFFFFFFF) for part in parts[:2])
    return LssRanges(vendor, product, *(_range(part) for part in parts[2:]))


def _range(told: Any) -> tuple[int, int]:
    """Return the lowest and the highest number, equal for a single number."""
    ends = told if isinstance(told, tuple) else (told, told)
    if len(ends) != 2:
        raise wrong("address", told, "a number, or the lowest and the highest")
    low, high = (whole("address", end, "a number of 32 bits", 0xFFFFFFFF) for end in ends)
    if low > high:
        raise wrong("address", told, "the lowest number first")
    return low, high


def _address(told: Any) -> LssAddress:
    from dvtcli.domain.lss_services import LssAddress

    parts = told.parts if isinstance(told, LssAddress) else told
    if not isinstance(parts, tuple | list) or len(parts) != 4:
        raise wrong("address", told, "an LssAddress, or vendor-ID, product code, revision and serial number")
    return LssAddress(*(whole("address", part, "a number of 32 bits", 0xFFFFFFFF) for part in parts))
