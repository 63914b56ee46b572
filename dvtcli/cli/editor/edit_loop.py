"""`edit`: the screen, then the change in the main thread, then the screen again."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.cli.conversation import Conversation
from dvtcli.cli.editor.editor import APPLY, LEAVE, Editor
from dvtcli.cli.screen.full_screen import has_full_screen, in_a_line
from dvtcli.cli.view.answers.change_lines import kept_text
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.device.seen_state import heartbeat_slots
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.links import LinkSide, agrees, linked, placed_mapping, receivers
from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.script_line import change_lines
from dvtcli.domain.text import join_some, plural
from dvtcli.errors import DvtcliError, SafetyRefusal, UsageError, ended_with
from dvtcli.operations.exchange.edit_file import (
    Edited,
    EditedFile,
    EditedLink,
    Edits,
    Judged,
    file_to_edit,
    refuse_other_values,
)
from dvtcli.operations.pdos.edit_pdos import apply_edited, edited_plan

if TYPE_CHECKING:
    from dvtcli.cli.pdo_params import NodePdo
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.pdo import Pdo, PdoConfig, PdoMappingEntry
    from dvtcli.domain.plan import Plan
    from dvtcli.domain.rules.finding import Finding
    from dvtcli.operations.results import Changed

#: exit codes after which the node was asked in vain, or is not what it was, or a signal came: no screen again
_ENDS = frozenset({5, 7, 129, 130, 143})
_NOT_WHAT_IT_WAS = ("unknown", "left_changed")


def edit(session: Conversation, pdo: NodePdo | None) -> None:
    """Show the editor of the PDO's node, or the selected node, until the user leaves; writes what is applied.

    Raises SafetyRefusal without a terminal, and errors of a change that leaves the node unknown or changed.
    """
    if not has_full_screen(session):
        raise SafetyRefusal("edit is a full screen, and there is no terminal", hint="map and set do the same in lines")
    session.keep_frames()
    node = session.node(None if pdo is None else pdo.node_id)
    editor = Editor(session, node, _shown_first(node, pdo))
    refused: DvtcliError | None = None
    applied: set[Pdo] = set()
    while editor.run() == APPLY:
        changed = editor.pdos.changed()
        try:
            result = apply_edited(session, editor.node, editor.pdos.held, changed)
        except DvtcliError as failed:
            if failed.exit_code in _ENDS or failed.state in _NOT_WHAT_IT_WAS or session.cancellation.requested:
                _say_edits(session, failed, edited_plan(node.node_id, editor.pdos.held, changed))
                raise
            if failed.state == "unchanged":  # the editor shows it; the shell only if it is not corrected
                refused = failed
            else:
                session.output.error(failed)
            editor.say(f"not applied: {error_text(failed)}", bad=True)
        else:
            refused = None
            applied.update(() if result.dry_run else changed)
            session.output.result(result)
            editor.say(_said(result, changed))
        session.cancellation.release()
        if session.cancellation.requested:  # asked for when the change was complete already
            ended = ended_with(session.cancellation.exit_code, "edit was ended by a signal", state="left_changed")
            ended.state_text = "applied changes were read back, and stay"
            raise ended
        if note := editor.pdos.read_again(node.pdos()):
            editor.say(f"{editor.view.message}; {note}", bad=True)
    if left := editor.pdos.changed():
        _say_left(session, left, applied, refused)


def _say_edits(session: Conversation, failed: DvtcliError, plan: Plan) -> None:
    """Show the edits of *plan* if it *failed* without a trace on the node: they end with the screen."""
    if failed.state in ("unchanged", "rolled_back"):
        for line in change_lines(plan):
            session.reporter.note(f"your edit as a command: {line}")


def _say_left(
    session: Conversation, left: Collection[Pdo], applied: Collection[Pdo], refused: DvtcliError | None
) -> None:
    """Show the last refusal, if any, that no later change corrected, and the PDOs *left* with edits.

    Those of *applied* keep what was applied; the others are as they were.
    """
    if refused is not None:
        session.output.error(refused)
    if again := [pdo.label for pdo in left if pdo in applied]:
        session.reporter.note(f"{', '.join(again)}: later edits discarded; what was applied stays")
    if untouched := [pdo.label for pdo in left if pdo not in applied]:
        session.reporter.note(f"{', '.join(untouched)} left as it was")


def _shown_first(node: ReadableNode, pdo: NodePdo | None) -> Pdo | None:
    """Return the PDO to show first; raises UsageError if *node* lacks it, or has no PDO at all."""
    if not node.pdos():
        raise UsageError(f"node {node.node_id} has no PDO to edit", node=node.node_id)
    if pdo is not None and pdo.pdo not in node.pdos():
        raise UsageError(
            f"node {node.node_id} has no {pdo.pdo.label}", hint=Hint(Action.SHOW_PDOS, why="shows its PDOs")
        )
    return None if pdo is None else pdo.pdo


def _said(result: Changed, changed: Collection[Pdo]) -> str:
    labels = ", ".join(pdo.label for pdo in changed)
    if result.dry_run:
        return f"dry run: {labels} would be set with {plural(len(result.plan), 'write')}; nothing was written"
    return f"{labels} set: {plural(len(result.plan), 'write')}, read back equal. {kept_text(result)}"


def edit_file(session: Conversation, file: str) -> None:
    """Show the editor of *file*'s nodes, simulated, until the user leaves; writes the file when it is applied.

    Raises SafetyRefusal without a terminal, and the errors of reading the file.
    """
    if not has_full_screen(session):
        raise SafetyRefusal("edit is a full screen, and there is no terminal", hint="a network file is text to edit")
    node_id, message, kept = None, "", "left as it was"
    while True:
        edited = file_to_edit(file)
        message = "; ".join(filter(None, (message, *edited.notes)))
        with simulated_nodes(session, edited) as inner:
            nodes = FileNodes(inner, edited, dry_run=session.dry_run)
            editor, written = _shown(session, nodes, nodes.editor(node_id), message)
            if not written:
                if left := nodes.changed():
                    session.reporter.note(f"{file}: {join_some(left)} {kept}")
                return
            node_id, message = editor.node.node_id, written
            kept = "left as it was written: later edits discarded"


@contextmanager
def simulated_nodes(session: Conversation, edited: EditedFile) -> Iterator[Conversation]:
    """Give a conversation whose simulated nodes hold what *edited* says; nothing of it reaches a bus."""
    call, options = session.output.call, session.options
    inner = Conversation(session.output)
    inner.base = inner.options = edited.options._replace(
        color=options.color, ascii=options.ascii, verbose=0, quiet=options.quiet, format=options.format
    )
    inner.started, inner.cancellation = True, session.cancellation
    try:
        edited.fill(inner)
        yield inner
    finally:
        inner.close()
        session.output.call = call


class FileNodes:
    """The nodes of a file, simulated in *session*, each with its editor once it was chosen."""

    def __init__(self, session: Conversation, edited: EditedFile, *, dry_run: bool = False) -> None:
        self._session, self._edited, self.dry_run = session, edited, dry_run
        self._editors: dict[int, Editor] = {}
        self._links: dict[Endpoint, EditedLink] = {}
        self.name = edited.file
        nodes = [session.node(node_id) for node_id in session.open_network().simulated_ids]
        self.nodes: Sequence[tuple[int, str]] = [
            (node.node_id, f"{name} ({node.title})" if (name := edited.names.get(node.node_id)) else node.title)
            for node in nodes
            if node.pdos()
        ]
        if not self.nodes:
            raise UsageError(f"{edited.file} has no PDO to edit", place=edited.file)

    def editor(self, node_id: int | None) -> Editor:
        """Return the editor of a node, None for the first."""
        found = self.nodes[0][0] if node_id is None else node_id
        if found not in self._editors:
            self._editors[found] = Editor(self._session, self._session.node(found), None, self)
        return self._editors[found]

    def changed(self) -> list[str]:
        """Return the changed PDOs of all nodes, as `5:tpdo1`, and the new links."""
        pdos = [f"{node_id}:{pdo}" for node_id, editor in self._editors.items() for pdo in editor.pdos.changed()]
        return [*pdos, *map(str, self.edits().links)]

    def edits(self) -> Edits:
        """Return the nodes with changes, and the links that still stand and that the file lacks."""
        nodes = {
            node_id: Edited(editor.node, editor.pdos.held, changed)
            for node_id, editor in self._editors.items()
            if (changed := editor.pdos.changed())
        }
        links = [link for link in list(self._links.values()) if self._stands(link) and self._edited.lacks(link)]
        return Edits(nodes, links)

    def _stands(self, link: EditedLink) -> bool:
        """Tell whether the RPDO of *link* receives its TPDO: neither was undone or edited away."""
        sent, received = self._side(link.producer).config, self._side(link.consumer).config
        ids = [(pdo.communication.cob_id.can_id, pdo.communication.cob_id.extended) for pdo in (sent, received)]
        return received.enabled and ids[0] == ids[1] and agrees(sent.mapping, received.mapping)

    def edited(self) -> Mapping[int, Edited]:
        """Return the nodes with changed PDOs."""
        return self.edits().nodes

    def judge(self, node_id: int, changed: Mapping[Pdo, PdoConfig]) -> Judged:
        """Return what the rules say of the file with the *changed* PDOs of a node."""
        editor, edits = self.editor(node_id), self.edits()
        nodes = {**edits.nodes, node_id: Edited(editor.node, editor.pdos.held, changed)}
        return self._edited.judge(replace(edits, nodes=nodes))

    def consumers(self, node_id: int) -> list[tuple[Endpoint, str]]:
        """Return the RPDOs of the other nodes, each with its objects."""
        return [
            (Endpoint(other_id, pdo), " ".join(entry.object for entry in config.mapping) or "maps nothing")
            for other_id, _ in self.nodes
            if other_id != node_id
            for pdo, config in self.editor(other_id).pdos.now.items()
            if not pdo.is_tpdo
        ]

    def receivers(self, producer: Endpoint, consumer: Endpoint) -> list[tuple[PdoMappingEntry, list[PdoMappingEntry]]]:
        """Return each object of *producer* with the objects that can receive it, if *consumer* maps none; else none."""
        sending, receiving = self._side(producer), self._side(consumer)
        if any(not entry.is_dummy for entry in receiving.config.mapping) or receiving.config.mpdo is not None:
            return []
        return [(sent, receivers(sending, sent, receiving)) for sent in sending.config.mapping]

    def link(self, from_: Endpoint, consumer: Endpoint, placed: Mapping[int, PdoMappingEntry]) -> tuple[str, bool]:
        """Let *consumer* receive the TPDO *from_*; returns what was done or refused, and whether it is bad.

        *placed* are the objects that receive the TPDO's, by number, for an RPDO that maps none.
        """
        producer, receiver = self._side(from_), self._side(consumer)
        if placed:
            mapping, refused = placed_mapping(producer, receiver, placed)
            if refused:
                return _remarks(refused), True
            config = replace(receiver.config, mapping=mapping)
            receiver = LinkSide(consumer, config, receiver.profile, receiver.dictionary)
        made = linked(producer, receiver)
        remarks = _remarks(made.findings)
        if not made.mapping:
            return remarks, True
        sent = producer.config.communication.cob_id
        cob_id = replace(receiver.config.communication.cob_id, can_id=sent.can_id, extended=sent.extended, valid=True)
        communication = replace(receiver.config.communication, cob_id=cob_id)
        config = replace(receiver.config, communication=communication, mapping=made.mapping)
        self.editor(consumer.node_id).pdos.put(consumer.pdo, config)
        self._links[consumer] = link = EditedLink(from_, consumer)
        note = self._edited.link_note(link)
        off = "" if producer.config.enabled else f"; {producer} is off"
        said = f"{receiver} receives {producer} with {sent}{off}{note and f'; {note}'}; n shows node {consumer.node_id}"
        return f"{said}. {remarks}" if remarks else said, False

    def offered_watch_ms(self, consumer: Endpoint) -> int | None:
        """Return a time for which the node of the linked *consumer* may watch the producer's heartbeat, else None."""
        slots = heartbeat_slots(self.editor(consumer.node_id).node.read_cache)
        return self._edited.offered_watch_ms(self._links[consumer], slots)

    def object_text(self, end: Endpoint, entry: PdoMappingEntry) -> str:
        """Return *entry* of the node of *end* with its name."""
        return f"{self._side(end).name(entry)}, {plural(entry.bits, 'bit')}"

    def watch(self, consumer: Endpoint, time_ms: int) -> None:
        """Write a heartbeat consumer of *time_ms* with the link to *consumer*."""
        self._links[consumer] = replace(self._links[consumer], watch_ms=time_ms)

    def _side(self, end: Endpoint) -> LinkSide:
        editor = self.editor(end.node_id)
        return LinkSide(end, editor.pdos.now[end.pdo], editor.node.profile, editor.node.dictionary)

    def save(self, session: Conversation, file: str) -> str | None:
        """Write all nodes as *file*, if it is of the same format; returns what was written.

        Raises UsageError for a DCF or XDC of another kind of file.
        """
        if _suffix(file) != _suffix(self.name):
            refuse_other_values(self.name, file)
            return None
        return self._edited.write(session, self.edits(), file)


def _remarks(findings: Sequence[Finding]) -> str:
    return "; ".join(f"{finding.text} [{finding.rule}]" for finding in findings)


def _suffix(file: str) -> str:
    return file.lower().rpartition(".")[2].replace("yml", "yaml")


def _shown(session: Conversation, nodes: FileNodes, editor: Editor, message: str) -> tuple[Editor, str]:
    """Show editors until the user leaves, or the file is written; returns the last one, and what was written."""
    editor.say(message)
    refused: DvtcliError | None = None
    while (outcome := editor.run()) != LEAVE:
        if outcome != APPLY:
            editor = nodes.editor(editor.next_node)
            editor.say("")
        elif nodes.dry_run:
            editor.say(f"dry run: {join_some(nodes.changed())} would be written; nothing was written")
        else:
            try:
                return editor, nodes.save(session, nodes.name) or ""
            except DvtcliError as failed:
                if session.cancellation.requested:
                    raise
                refused = failed  # the editor shows it; the shell only if it is not corrected
                editor.say(f"not written: {in_a_line(session, failed)}", bad=True)
    if refused is not None and nodes.changed():
        session.output.error(refused)
    return editor, ""
