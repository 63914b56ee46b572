"""The part of a session that operations on nodes need: its user, its bus and its nodes.

An operation that takes a part cannot open, close or reconfigure the session: mypy refuses it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeVar

from dvtcli.operations.user.session_user import SessionUser

if TYPE_CHECKING:
    from collections.abc import Callable

    from dvtcli.device.node import Node
    from dvtcli.domain.ports import CanopenBus
    from dvtcli.operations.session.open_network import Network
    from dvtcli.operations.session.session import Record

T = TypeVar("T")


class SessionNodes(SessionUser, Protocol):
    """The bus and the nodes of a session, as `Session` has them."""

    @property
    def is_open(self) -> bool:
        """Whether the bus was opened."""

    @property
    def wire(self) -> CanopenBus:
        """The bus itself, also under --dry-run: to listen to, never to write to."""

    @property
    def bus(self) -> CanopenBus:
        """The bus, or the twins' under --dry-run."""

    @property
    def network(self) -> Network:
        """The bus with its nodes, or their twins under --dry-run; opened at first use."""

    @property
    def selected(self) -> int | None:
        """The node-ID selected by `node ID`."""

    @property
    def record(self) -> Record:
        """The successful changes as script lines."""

    def open_network(self) -> Network:
        """See `Opened.open_network`."""

    def node(self, node_id: int | None = None) -> Node:
        """See `Session.node`."""

    def node_id(self) -> int:
        """See `Session.node_id`."""

    def selected_id(self) -> int | None:
        """See `Session.selected_id`."""

    def default_id(self) -> int:
        """See `Session.default_id`."""

    def known_ids(self) -> list[int]:
        """See `Session.known_ids`."""

    def seen_nodes(self) -> dict[int, Node]:
        """See `Opened.seen_nodes`."""

    def read_together(self, look: Callable[[], T]) -> T:
        """See `Session.read_together`."""
