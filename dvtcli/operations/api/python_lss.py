"""LSS for a program: what `dvtcli lss` does, on an open bus. Prints nothing and asks nobody."""

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

    def scan(self, wait_s: float = 0.05) -> LssFound:
        """Find every node without a node-ID by fast scan; each question waits *wait_s* seconds (0.005…2).

        True where there are some; `nodes` are those. NoAnswer where the answers do not fit together.
        """
        from dvtcli.operations.lss.lss_find import lss_scan

        number("wait_s", wait_s, "a number of seconds, 0.005…2", low=0.005, high=2)
        return self._calls.run(lambda: lss_scan(self._calls.session, wait_s))

    def identify(self, address: LssAddress | tuple[Any, Any, Any, Any] | None = None) -> LssFound:
        """Whether a node with *address* is there; None: how many without a node-ID say so (`answered`).

        Its revision and serial number may be pairs, lowest and highest: then `within` says whether one such is there.
        """
        from dvtcli.operations.lss.lss_find import lss_identify

        wanted = None if address is None else _address_or_ranges(address)
        return self._calls.run(lambda: lss_identify(self._calls.session, wanted))

    def select(self, who: LssAddress | tuple[int, int, int, int] | int) -> LssFound:
        """Let the node with that address, or with that node-ID (1…127), be configured alone: `node_id` is about it.

        NoAnswer where nobody has it, DeviceRefused where several have.
        """
        from dvtcli.operations.lss.lss_find import lss_select

        one = whole("who", who, "a node-ID", 127, low=1) if isinstance(who, int) else _address(who)
        return self._calls.run(lambda: lss_select(self._calls.session, one))

    def node_id(
        self, node_id: int, address: LssAddress | tuple[int, int, int, int] | None = None, *, yes: bool = False
    ) -> LssChanged:
        """Give *node_id* (1…127) to the node with *address*, None: to the one that was selected.

        Asks first, unless *yes*. Done once the node says by SDO, on its new node-ID, that it is the one. SafetyRefusal
        where the node-ID is in use; LeftChanged where it did not come up and could not get the old one back.
        """
        from dvtcli.operations.lss.lss_node_id import lss_node_id

        wanted = None if address is None else _address(address)
        whole("node_id", node_id, "a node-ID", 127, low=1)
        return self._calls.run(lambda: lss_node_id(self._calls.session, node_id, wanted), yes=yes)

    def store(self, node_id: int, *, prove: bool = False, yes: bool = False) -> LssChanged:
        """Let the node with *node_id* keep that without power; with *prove* reset it then, and look again.

        Asks first, unless *yes*. DeviceRefused with its reason, LeftChanged where it comes back without its node-ID.
        """
        from dvtcli.operations.lss.lss_store import lss_store

        whole("node_id", node_id, "a node-ID", 127, low=1)
        flags(prove=prove)
        return self._calls.run(lambda: lss_store(self._calls.session, node_id, prove=prove), yes=yes)

    def assign(self, file: str | Path, *, store: bool = False, prove: bool = False, yes: bool = False) -> LssChanged:
        """Give the nodes of the network *file* the node-IDs that it says, each found by its identity there.

        Asks first, unless *yes*; with *store* they store them, once all came up, and with *prove* each is reset then.
        `missing` are those that were not found. Where one does not come up all get back what they had.
        """
        from dvtcli.operations.lss.lss_assign import lss_assign

        chosen = str(path("file", file))
        flags(store=store, prove=prove)
        return self._calls.run(lambda: lss_assign(self._calls.session, chosen, stores=store, prove=prove), yes=yes)

    def bit_rate(
        self, bit_rate: int, file: str | Path | None = None, *, store: bool = False, prove: bool = False,
        yes: bool = False,
    ) -> LssBitRate:  # fmt: skip
        """Let the bus and every node on it run at *bit_rate* (bit/s, one of the standard's).

        With *file* just the nodes of that network may be there. Asks first, unless *yes*; with *store* each stores it,
        once all are back, and with *prove* all are reset then, and seen at it. SafetyRefusal where anybody else is
        heard, there is no way back, or a drive that may move would be reset; where one does not come back all go back;
        LeftChanged where that fails, too.
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
    """The lowest and the highest number, both the same where one is told."""
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
