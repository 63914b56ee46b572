"""A file whose nodes are edited, and the questions that link its TPDOs to RPDOs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

from dvtcli.cli.screen.widgets import Choices, Dialog, Question

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.domain.network.network_config import Endpoint
    from dvtcli.domain.pdo import Pdo, PdoConfig, PdoMappingEntry
    from dvtcli.operations.exchange.edit_file import Edited, Judged


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

    def edited(self) -> Mapping[int, Edited]:
        """Return the nodes with changed PDOs."""
        ...

    def judge(self, node_id: int, changed: Mapping[Pdo, PdoConfig]) -> Judged:
        """Return what the rules say of the file with the *changed* PDOs of a node."""
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


#: for each object that a TPDO sends, the objects that can receive it
Receivers = Sequence[tuple["PdoMappingEntry", Sequence["PdoMappingEntry"]]]


class LinkDialogs:
    """Links the TPDO *producer* of *file*: *show* opens a dialog, *made* takes the result, and whether it is bad."""

    def __init__(
        self,
        file: FileOfNodes,
        producer: Endpoint,
        show: Callable[[Dialog], None],
        made: Callable[[str, bool], None],
    ) -> None:
        self._file, self._producer, self._show, self._made = file, producer, show, made

    def choose_consumer(self) -> None:
        """Ask for the RPDO."""
        consumers = self._file.consumers(self._producer.node_id)

        def chosen(number: int) -> None:
            consumer = consumers[number][0]
            if receivers := self._file.receivers(self._producer, consumer):
                self._choose_objects(consumer, receivers, 0, {})
            else:
                self._link(consumer, {})

        rows = [(str(number % 10) if number < 10 else " ", f"{end.node_id}:{end.pdo}  {objects}")
                for number, (end, objects) in enumerate(consumers, 1)]  # fmt: skip
        self._show(Choices(f"{self._producer.pdo.label} to which RPDO?", rows, chosen))

    def _choose_objects(
        self, consumer: Endpoint, receivers: Receivers, number: int, placed: Mapping[int, PdoMappingEntry]
    ) -> None:
        """Ask which object receives the TPDO's object *number* and those behind it, then link; *placed* are chosen."""
        number = next((at for at in range(number, len(receivers)) if receivers[at][1]), len(receivers))
        if number == len(receivers):
            if placed:
                self._link(consumer, placed)
            else:
                none_fits = not any(offered for _, offered in receivers)
                why = "is as long as one that it would receive" if none_fits else "was chosen"
                end = f"{consumer.node_id}:{consumer.pdo}"
                self._made(f"not linked: {end} maps nothing, and no object of its node {why}", True)
            return
        sent, offered = receivers[number]

        def chosen(row: int) -> None:
            more = {number: offered[row - 1]} if row else {}
            self._choose_objects(consumer, receivers, number + 1, {**placed, **more})

        rows = [("s", "skip it"), *((" ", self._file.object_text(consumer, entry)) for entry in offered)]
        text = self._file.object_text(self._producer, sent)
        self._show(Choices(f"which object of node {consumer.node_id} receives {text}?", rows, chosen))

    def _link(self, consumer: Endpoint, placed: Mapping[int, PdoMappingEntry]) -> None:
        """Link, then ask whether the consumer's node is to watch the producer's heartbeat."""
        said, is_bad = self._file.link(self._producer, consumer, placed)
        self._made(said, is_bad)
        watch_ms = None if is_bad else self._file.offered_watch_ms(consumer)
        if watch_ms is None:
            return

        def answered(answer: bool) -> None:
            if answer:
                self._file.watch(consumer, watch_ms)

        nodes = f"node {consumer.node_id} does not watch the heartbeat of node {self._producer.node_id}"
        self._show(Question(f"{nodes}: add it, {watch_ms} ms?", answered))
