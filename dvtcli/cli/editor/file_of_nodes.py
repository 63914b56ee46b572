"""A file whose nodes are edited, as the editor's screen uses it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.editor.draw import Remark
    from dvtcli.domain.network.network_config import Endpoint
    from dvtcli.domain.pdo import Pdo, PdoConfig, PdoMappingEntry


class FileOfNodes(Protocol):
    """A file of which an editor shows a node."""

    @property
    def name(self) -> str:
        """The file as named by the user."""
        ...

    @property
    def nodes(self) -> Sequence[tuple[int, str]]:
        """The node-IDs with the names of their nodes."""
        ...

    @property
    def dry_run(self) -> bool:
        """Whether the file stays as it is, and only files that the user names are written."""
        ...

    def changed(self) -> Sequence[str]:
        """The changed PDOs of all nodes, in words."""
        ...

    def judge(self, node_id: int, changed: Mapping[Pdo, PdoConfig]) -> tuple[Mapping[Pdo, Sequence[Remark]], str]:
        """Return what the rules say of a node with its *changed* PDOs, and the state of the file in a line."""
        ...

    def consumers(self, node_id: int) -> Sequence[tuple[Endpoint, str]]:
        """Return the RPDOs of the other nodes, each with its objects."""
        ...

    def receivers(
        self, producer: Endpoint, consumer: Endpoint
    ) -> Sequence[tuple[PdoMappingEntry, Sequence[PdoMappingEntry]]]:
        """Return each object of *producer* with the objects that can receive it, if *consumer* maps none; else none."""
        ...

    def link(self, from_: Endpoint, consumer: Endpoint, placed: Mapping[int, PdoMappingEntry]) -> tuple[str, bool]:
        """Let *consumer* receive the TPDO *from_*; returns what was done or refused, and whether it is bad.

        *placed* are the objects that receive the TPDO's, by number, for an RPDO that maps none.
        """
        ...

    def offered_watch_ms(self, consumer: Endpoint) -> int | None:
        """Return a time for which the node of the linked *consumer* may watch the producer's heartbeat, else None."""
        ...

    def object_text(self, end: Endpoint, entry: PdoMappingEntry) -> str:
        """Return *entry* of the node of *end* with its name."""
        ...

    def watch(self, consumer: Endpoint, time_ms: int) -> None:
        """Write a heartbeat consumer of *time_ms* with the link to *consumer*."""
        ...

    def save(self, session: Conversation, file: str) -> str | None:
        """Write all as *file*; returns what was written, None if its suffix is another format's."""
        ...
