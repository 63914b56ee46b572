"""LSS through a gateway: a slave is selected by its address for each order.

The selection belongs to the client.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.gateway.gateway_answers import Answer, Done, Failed, GatewayError
from dvtcli.domain.lss_services import LssAddress, LssRanges
from dvtcli.domain.nmt import UNCONFIGURED

if TYPE_CHECKING:
    from dvtcli.operations.gateway.line_client import LineClient
    from dvtcli.operations.session.session_nodes import SessionNodes

#: LSS orders
LSS = (
    "lss_switch_glob", "lss_switch_sel", "lss_set_node", "lss_conf_bitrate", "lss_activate_bitrate", "lss_store",
    "lss_inquire_addr", "lss_get_node", "lss_identity", "lss_ident_nonconf", "_lss_fastscan",
)  # fmt: skip
#: command specifier of the first part of an address (CiA 305)
_FIRST_PART = 0x5A
#: orders that change a slave, if only its LSS state: a fast scan puts the slave found in configuration, too (CiA
#: 305)
_CHANGES = ("lss_set_node", "lss_store", "lss_switch_sel", "_lss_fastscan")
_SWITCH_ALL = ("lss_switch_glob", (1,))
_RATES = "a bus whose nodes run at two bit rates is dead; dvtcli changes the rate of all, and takes it back"
_ALL = "all slaves at once would get one node-ID; lss_switch_sel selects one"
READ_ONLY = Failed(GatewayError.INTERNAL_STATE, "read-only: this gateway allows no changes")


class LssLines:
    """LSS orders of all clients: a bus has a single LSS master, so each order selects its slave again."""

    def __init__(self, session: SessionNodes, *, allow_changes: bool) -> None:
        self._session = session
        self._allow_changes = allow_changes

    def answer(self, client: LineClient, name: str, numbers: tuple[int, ...]) -> Answer:
        """Return the answer to the order *name* of *client*."""
        if not self._allow_changes and (name in _CHANGES or (name, numbers) == _SWITCH_ALL):
            return READ_ONLY
        if self._session.dry_run:
            return Failed(GatewayError.INTERNAL_STATE, "dry run: no LSS is sent, so that nobody can answer")
        return self._answered(client, name, numbers)

    def _answered(self, client: LineClient, name: str, numbers: tuple[int, ...]) -> Answer:
        match name, numbers:
            case "lss_switch_glob", (0,):
                client.selected = None
                return Done()
            case "lss_switch_sel", (vendor, product, revision, serial):
                return self._select(client, LssAddress(vendor, product, revision, serial))
            case "lss_identity" | "lss_ident_nonconf", _:
                return self._identify(numbers)
            case "_lss_fastscan", _:
                return self._scan()
            case "lss_conf_bitrate" | "lss_activate_bitrate", _:
                return Failed(GatewayError.NOT_SUPPORTED, _RATES)
            case "lss_switch_glob", _:
                return Failed(GatewayError.NOT_SUPPORTED, _ALL)
        if client.selected is None:
            return Failed(GatewayError.LSS, "no slave is selected: lss_switch_sel comes first")
        return self._of_selected(client.selected, name, numbers)

    def _select(self, client: LineClient, address: LssAddress) -> Answer:
        client.selected = None
        self._node_id(address)
        client.selected = address
        return Done()

    def _node_id(self, address: LssAddress) -> int:
        """Return the slave's current node-ID, 255 for none: another client may have set it."""
        from dvtcli.operations.lss.lss_find import lss_select

        # It waits again at once, and each order selects it again: a client that leaves leaves no slave in
        # configuration.
        found = lss_select(self._session, address, keep=False)
        node_id = found.nodes[0].node_id if found.nodes else None
        return UNCONFIGURED if node_id is None else node_id

    def _identify(self, numbers: tuple[int, ...]) -> Answer:
        """Tell whether a slave is within the ranges, or has no node-ID if none are given."""
        from dvtcli.operations.lss.lss_find import lss_identify

        if numbers:
            vendor, product, low_revision, high_revision, low_serial, high_serial = numbers
            wanted = LssRanges(vendor, product, (low_revision, high_revision), (low_serial, high_serial))
            there = bool(lss_identify(self._session, wanted).within)
        else:
            there = bool(lss_identify(self._session, None).answered)
        return Done() if there else Failed(GatewayError.TIME_OUT, "no slave answered")

    def _scan(self) -> Answer:
        """Return the address of the first slave without a node-ID."""
        from dvtcli.operations.lss.lss_find import lss_scan

        found = lss_scan(self._session).nodes
        if not found:
            return Failed(GatewayError.TIME_OUT, "no slave waits for a node-ID")
        return Done(" ".join(f"0x{part:08X}" for part in found[0].address.parts))

    def _of_selected(self, address: LssAddress, name: str, numbers: tuple[int, ...]) -> Answer:
        if name == "lss_inquire_addr":
            part = numbers[0] if numbers else 0
            part = part - _FIRST_PART if part >= _FIRST_PART else part
            if part > 3:
                return Failed(GatewayError.SYNTAX, "an address has the parts 0 to 3, or 0x5A to 0x5D")
            return Done(f"0x{address.parts[part]:08X}")
        if name == "lss_get_node":
            return Done(str(self._node_id(address)))
        return self._set_node(address, numbers[0]) if name == "lss_set_node" else self._store(address)

    def _store(self, address: LssAddress) -> Answer:
        from dvtcli.operations.lss.lss_store import lss_store

        node_id = self._node_id(address)
        if node_id == UNCONFIGURED:
            return Failed(GatewayError.LSS_STORE, "the slave has no node-ID to store")
        done = lss_store(self._session, node_id)
        return Failed(GatewayError.LSS_STORE) if done.exit_code else Done()

    def _set_node(self, address: LssAddress, node_id: int) -> Answer:
        from dvtcli.operations.lss.lss_node_id import lss_node_id

        if not 1 <= node_id <= 127:
            return Failed(GatewayError.LSS_NODE_ID)
        done = lss_node_id(self._session, node_id, address)
        if done.exit_code:
            return Failed(GatewayError.LSS_NODE_ID)
        self._session.tell.note(f"node-ID {node_id} <- {address}")
        return Done()
