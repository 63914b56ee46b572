"""The mapping editor on the screen: keys, mouse, and what runs beside it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from prompt_toolkit.application import get_app
from prompt_toolkit.key_binding import KeyBindings

from dvtcli.cli.editor.draw import (
    ALL_KEYS,
    FRAME,
    OBJECTS,
    PDOS,
    EditorView,
    Named,
    frame_rows,
    key_at,
    pane_at,
    picture,
    row_at,
)
from dvtcli.cli.editor.file_of_nodes import LinkDialogs
from dvtcli.cli.editor.model import COB_ID, PARAMETERS, EditedPdos, ObjectList
from dvtcli.cli.editor.plan_dialog import plan_dialog
from dvtcli.cli.screen.full_screen import BesideScreen, bind_all, show
from dvtcli.cli.screen.widgets import Choices, Dialog, FieldDialog, Question, TextDialog, cut
from dvtcli.cli.view.lines import Cell, broken
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.object_scalings import value_text
from dvtcli.domain.object_syntax import Skipped
from dvtcli.domain.pdo import DUMMY_BITS, PdoMappingEntry, split_dummy
from dvtcli.domain.rules.pdo_mapping import known_dummies
from dvtcli.domain.text import join_some
from dvtcli.errors import BusUnavailable, DvtcliError, UsageError
from dvtcli.operations.exchange.edit_file import Edited
from dvtcli.operations.exchange.export_file import refuse_suffix, save_edited
from dvtcli.operations.pdos.edit_pdos import judge_edited
from dvtcli.operations.pdos.list_pdos import last_frame
from dvtcli.operations.values.named_objects import entry_at
from dvtcli.operations.values.object_values import scalings_of

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.editor.draw import Remark
    from dvtcli.cli.editor.file_of_nodes import FileOfNodes
    from dvtcli.device.node import Node
    from dvtcli.domain.pdo import Pdo, PdoConfig

#: what the user left the screen for
APPLY, LEAVE, NODE = "apply", "leave", "node"
#: maximum wait for the rules when the screen is left (s)
_LEAVE_S = 10.0
_DUMMY_HINT = "bits to skip, as 8 or 16"


class Editor:
    """The PDOs of *node* while they are edited, of a *file* if they are; *chosen* is shown first."""

    def __init__(self, session: Conversation, node: Node, chosen: Pdo | None, file: FileOfNodes | None = None) -> None:
        self._session, self.node, self._file = session, node, file
        self.pdos = EditedPdos(node.pdos())
        order = list(self.pdos.held)
        title = f'{"" if file is None else f"{file.name}  "}node {node.node_id} "{node.title}"'
        self.view = EditorView(
            title, self.pdos, order, plain=session.output.plain, of_file=file is not None,
            has_nodes=file is not None and len(file.nodes) > 1,
        )  # fmt: skip
        #: the node chosen next, with the outcome `NODE`
        self.next_node = node.node_id
        if chosen is not None:
            self.view.pdo_cursor.chosen = order.index(chosen)
            self.view.pane = FRAME
        self._scalings = scalings_of(node.profile, node.dictionary)
        self._objects = ObjectList(node.dictionary, node.profile, self._scalings)
        self._dialogs: list[Dialog] = []
        self._happened = node.bus.happened(node.node_id)
        self._judged: dict[Pdo, PdoConfig] | None = None
        self._judge: threading.Thread | None = None
        self._found: Mapping[Pdo, Sequence[Remark]] = {}
        self._fault: BaseException | None = None
        self._beside: BesideScreen | None = None
        self._leaving = False
        self._rows = self._columns = self._dialog_row = 0
        self.outcome = LEAVE

    def run(self) -> str:
        """Show the screen until it is left; returns `APPLY` or `LEAVE`."""
        self.outcome, self._leaving = LEAVE, False
        self._beside = BesideScreen(self._session)
        keys = KeyBindings()
        bind_all(keys, self.press, lambda: True)
        show(self._session, self, keys, None, self.mouse)
        return self.outcome

    @property
    def beside(self) -> BesideScreen:
        """What runs beside the screen."""
        assert self._beside is not None  # noqa: S101 - the screen is shown
        return self._beside

    def leave(self) -> None:
        """Wait for what runs beside the screen."""
        self._leaving = True
        self.beside.leave()
        if self._judge is not None:
            self._judge.join(_LEAVE_S)
            if self._judge.is_alive() and self.outcome == APPLY:
                raise DvtcliError("the rules are still reading the node: nothing was applied", node=self.node.node_id)

    def say(self, message: str, *, bad: bool = False) -> None:
        """Show *message* below."""
        self.view.message, self.view.is_bad = message, bad

    def gather(self) -> None:
        """Take what is new: messages, findings, values, and what happened to the node."""
        for message, bad in self.beside.news():
            self.say(message, bad=bad)
        if self._fault is not None:
            raise self._fault
        self._ask_rules()
        self.view.changed = self._shown_changes()
        try:
            happened = self.node.bus.happened(self.node.node_id)
            self._session.wire.drain()
        except BusUnavailable as gone:
            self.view.lost = error_text(gone)
            return
        self.view.lost = ""
        if happened != self._happened and not self.beside.doing:
            self.beside.start("reading the node again", lambda: self._read_again(happened))
        self.view.names = dict(self._names())

    def _read_again(self, happened: tuple[int, int]) -> str:
        self.node.read_anew()
        note = self.pdos.read_again(self.node.pdos())
        self.node.forget_restart(failed=True)  # the user is told, so a change after the restart is meant
        self._judged, self._happened = None, happened
        if note:
            self.beside.say(f"the node was read again: {note}", bad=True)
            return ""
        return (
            "the node restarted, another client wrote to it, or an answer was late: it was read again; your edits "
            "are kept"
        )

    def _names(self) -> Iterator[tuple[PdoMappingEntry, Named]]:
        """Yield each entry of the chosen PDO with its name, and its value if the node holds that mapping."""
        view, dictionary = self.view, self.node.dictionary
        values: Mapping[PdoMappingEntry, str] = {}
        sends = self.node.bus.nmt_state(self.node.node_id) in (None, NmtState.OPERATIONAL)
        if sends and view.config == self.pdos.held.get(view.pdo):
            received = last_frame(self._session, self.node, view.pdo, view.config)
            values = {} if received is None else {
                entry: value_text(value, self._scalings.of(entry.index, entry.sub_index), entry.bits)
                for entry, value in zip(view.config.mapping, received.values, strict=True) if value is not None
            }  # fmt: skip
        for entry in view.config.mapping:
            name = "" if dictionary is None else dictionary.display_name(entry.index, entry.sub_index)
            yield entry, Named(name, values.get(entry, ""))

    def _ask_rules(self) -> None:
        """Ask the rules about what is edited, in a thread: they may read the node."""
        changed = self.pdos.changed()
        if changed == self._judged:
            self.view.findings = self._found
            return
        if self._judge is not None and self._judge.is_alive():
            self.view.findings = None
            return

        def judge() -> None:
            try:
                with self.beside.turn:
                    if self._leaving:
                        return
                    if self._file is None:
                        self._found = judge_edited(self.node, self.pdos.held, changed)
                    else:
                        judged = self._file.judge(self.node.node_id, changed)
                        self._found = judged.findings.get(self.node.node_id, {})
                        self.view.status, self.view.listed = judged.status, judged.listed
                self.view.not_judged = ""
            except DvtcliError as failed:
                self.view.not_judged = error_text(failed)
                self._found = {}
            except BaseException as fault:  # noqa: BLE001 - nobody sees what ends a thread: `gather` raises it
                self._fault = fault
            self._judged = changed

        self._judge = threading.Thread(target=judge, name="asking the rules", daemon=True)
        self._judge.start()

    def lines(self, columns: int, rows: int) -> list[list[Cell]]:
        """Return the screen, an open dialog over its end."""
        self._columns, self._rows = columns, rows
        view = self.view
        self._offer()
        drawn = picture(view, columns, rows)
        dialog = self._dialog()
        if dialog is not None:
            block = [cut(line, columns, plain=view.plain) for line in dialog.lines(columns, rows - 2)]
            drawn[-len(block) :] = block
            self._dialog_row = len(drawn) - len(block)
        return drawn

    def _offer(self) -> None:
        """Look up what the filter offers: keys come faster than pictures."""
        view = self.view
        left = self.pdos.bits_left(view.pdo)
        view.offers = self._objects.offers(view.filter.text, tpdo=view.pdo.is_tpdo, bits_left=left)

    def _dialog(self) -> Dialog | None:
        return self.beside.question or (self._dialogs[-1] if self._dialogs else None)

    def press(self, key: str, text: str) -> None:
        """Take a key."""
        dialog = self._dialog()
        if dialog is not None:
            if not dialog.press(key, text) and dialog in self._dialogs:
                self._dialogs.remove(dialog)
            return
        self.say("")
        if key in _ALWAYS:
            _ALWAYS[key](self)
        elif text == "?" and self.view.pane != OBJECTS:
            self._help()
        elif text == "c" and self.view.pane != OBJECTS:
            self._show_findings()
        elif text in _OF_NODES and self.view.pane != OBJECTS:
            self._press_of_nodes(text)
        elif self.view.pane == PDOS:
            self._press_pdos(key, text)
        elif self.view.pane == FRAME:
            self._press_frame(key, text)
        else:
            self._press_objects(key, text)

    def mouse(self, act: str, column: int, row: int) -> None:
        """Choose a row by a click, and scroll by the wheel; a click on the chosen row is Enter, on a key that key."""
        dialog = self._dialog()
        if act != "click":
            self.press(act, "")
        elif dialog is not None:
            if dialog.click(row - self._dialog_row):
                self.press("enter", "")
        elif (key := key_at(self.view, column, row - self._rows)) is not None:
            self.press(*key)
        else:
            self._click(column, row)

    def _click(self, column: int, row: int) -> None:
        """Choose the pane and the row there; Enter if they are chosen already."""
        view = self.view
        before, view.pane = view.pane, pane_at(view, self._columns, column)
        number = row_at(view, row, self._columns, self._rows)
        cursor = (view.pdo_cursor, view.frame_cursor, view.object_cursor)[view.pane]
        if number is None:
            return
        if (view.pane, number) == (before, cursor.chosen):
            self.press("enter", "")
        elif view.pane == PDOS:
            self._choose_pdo(number)
        else:
            cursor.chosen = number

    def _choose_pdo(self, number: int) -> None:
        self.view.pdo_cursor.chosen = max(0, min(len(self.view.order) - 1, number))
        self.view.frame_cursor.chosen = self.view.frame_cursor.top = 0

    def _next_pane(self, step: int) -> None:
        self.view.pane = (self.view.pane + step) % 3
        self.view.replaces = False

    def _press_pdos(self, key: str, text: str) -> None:
        if key == "enter":
            self.view.pane = FRAME
        elif text == "e":
            self._switch()
        elif text == "a":
            self._to_objects(replaces=False)
        elif self.view.pdo_cursor.press(key, len(self.view.order)):
            self._choose_pdo(self.view.pdo_cursor.chosen)

    def _switch(self) -> None:
        if not self.view.config.has_cob_id:
            self.say("the COB-ID of this PDO cannot be read", bad=True)
        else:
            self.pdos.switch(self.view.pdo)

    def _press_frame(self, key: str, text: str) -> None:
        view, at = self.view, self.view.frame_cursor.chosen
        is_entry = at < len(view.config.mapping)
        if view.frame_cursor.press(key, frame_rows(view.config)):
            return
        if text == "e":
            self._switch()
        elif text == "a":
            self._to_objects(replaces=False)
        elif text == "s":
            self._ask("skip", "8", self._skip, _DUMMY_HINT)
        elif is_entry:
            self._press_entry(key, text, at)
        elif key == "enter":
            self._edit_parameter(at - len(view.config.mapping))

    def _press_entry(self, key: str, text: str, at: int) -> None:
        """Take a key for the entry number *at*."""
        view = self.view
        if text == "d" or key == "delete":
            self.pdos.remove(view.pdo, at)
        elif text in ("<", ">") or key in ("left", "right"):
            view.frame_cursor.chosen = self.pdos.move(view.pdo, at, -1 if text == "<" or key == "left" else 1)
        elif text == "r":
            self._to_objects(replaces=True)
        elif key == "enter" or text == "l":
            self._ask("length in bits", str(view.config.mapping[at].bits), self._set_length)

    def _to_objects(self, *, replaces: bool) -> None:
        if self.view.config.mpdo is not None:
            self.say("a multiplexed PDO has no mapping to edit", bad=True)
            return
        self.view.pane, self.view.replaces = OBJECTS, replaces

    def _ask(self, label: str, text: str, done: Callable[[str], str], help_text: str = "") -> None:
        self._dialogs.append(FieldDialog(label, text, done, help_text))

    def _edit_parameter(self, number: int) -> None:
        parameter, pdo = PARAMETERS[number], self.view.pdo
        shown = parameter.text(pdo, self.view.config)
        if shown == "not there":
            self.say(f"{pdo.label} of this node has no {parameter.name}", bad=True)
            return

        def done(text: str) -> str:
            if parameter.name == COB_ID and text.lower() == "keep":
                return ""
            if parameter.name == COB_ID and text.lower() == "auto":
                default = pdo.default_can_id(self.node.node_id)
                if default is None:
                    return f"{pdo.label} has no CAN-ID in the pre-defined connection set: enter a CAN-ID"
                text = f"0x{default:X}"
            try:
                self.pdos.put(pdo, parameter.set(self.pdos.now[pdo], text))
            except ValueError as wrong:
                return str(wrong)
            return ""

        self._ask(parameter.name, shown.split()[0], done, parameter.help)

    def _set_length(self, text: str) -> str:
        view, at = self.view, self.view.frame_cursor.chosen
        entry = view.config.mapping[at]
        if not text.isdecimal() or not 1 <= int(text) <= 64:
            return f"{text or 'nothing'}: 1…64 bits"
        self.pdos.replace(view.pdo, at, PdoMappingEntry(entry.index, entry.sub_index, int(text)))
        return ""

    def _skip(self, text: str) -> str:
        """Add dummies of the bits in *text*, as `map … dummy/16` does."""
        view = self.view
        if not text.isdecimal() or not 1 <= int(text) <= 64:
            return f"{text or 'nothing'}: 1…64 bits"
        try:
            dummies = split_dummy(int(text), known_dummies(self.node.dictionary, self.node.profile) or DUMMY_BITS)
        except ValueError as wrong:
            return str(wrong)
        self.pdos.insert(view.pdo, len(view.config.mapping), *dummies)
        view.frame_cursor.chosen = len(view.config.mapping) - 1
        return ""

    def _press_objects(self, key: str, text: str) -> None:
        view = self.view
        self._offer()
        if key == "enter":
            self._map()
        elif key in ("home", "end", "left", "right") or not view.object_cursor.press(key, len(view.offers)):
            before = view.filter.text
            view.filter.press(key, text)
            if view.filter.text != before:
                view.object_cursor.chosen = view.object_cursor.top = 0

    def _map(self) -> None:
        """Map the chosen object; without an EDS the typed one."""
        view = self.view
        if not view.offers:
            self._map_typed()
            return
        offer = view.offers[view.object_cursor.chosen]
        entry = offer.listed.entry
        if offer.reason and not offer.is_too_long:
            self.say(f"{entry.object}: {offer.reason}", bad=True)
            return
        if entry.bits is None:
            self.say(f"{entry.object}: its length is unknown; enter it as {entry.object}/32", bad=True)
            return
        self._place(PdoMappingEntry(entry.index, entry.sub_index, entry.bits), *self._place_now())

    def _map_typed(self) -> None:
        """Map what the filter says, as `map` reads it; its length is read from the node if it is not typed."""
        typed, place = self.view.filter.text, self._place_now()

        def work() -> str:
            mapped = entry_at(self.node, typed)
            if isinstance(mapped, Skipped):
                raise UsageError("s in the frame skips bits")
            bits = mapped.bits or self.node.length_of(mapped.index, mapped.sub_index)
            if bits is None:
                raise UsageError(f"{typed}: its length is unknown; enter it as {typed}/32")
            self._place(PdoMappingEntry(mapped.index, mapped.sub_index, bits), *place)
            return ""

        self.beside.start(f"map {typed}", work)

    def _place_now(self) -> tuple[Pdo, int, PdoMappingEntry | None]:
        """Return the chosen PDO, the number of the chosen entry, and the entry if it is to be replaced."""
        view, at = self.view, self.view.frame_cursor.chosen
        mapping = view.config.mapping
        return view.pdo, at, mapping[at] if view.replaces and at < len(mapping) else None

    def _place(self, entry: PdoMappingEntry, pdo: Pdo, at: int, replaced: PdoMappingEntry | None) -> None:
        """Map *entry* in *pdo*, instead of *replaced* at *at*, or behind all; raises UsageError if that has changed."""
        view, mapping = self.view, self.pdos.now[pdo].mapping
        if replaced is None:
            self.pdos.insert(pdo, len(mapping), entry)
        elif mapping[at : at + 1] == (replaced,):
            self.pdos.replace(pdo, at, entry)
        else:
            raise UsageError(f"{entry.object} is not mapped: {pdo.label} was changed in between")
        if pdo == view.pdo and replaced is None:
            view.frame_cursor.chosen = len(mapping)
        elif pdo == view.pdo:
            view.pane, view.replaces = FRAME, False
        view.filter.press("c-e", "")
        view.filter.press("c-u", "")
        view.object_cursor.chosen = view.object_cursor.top = 0
        switch = "" if self.pdos.now[pdo].enabled else f"; {pdo.label} is off: Tab, then e enables it"
        self.say(f"{entry.object}/{entry.bits} is mapped; Enter maps another, Tab leaves the list{switch}")

    def _undo(self) -> None:
        if not self.pdos.undo():
            self.say("nothing to undo")

    def _redo(self) -> None:
        if not self.pdos.redo():
            self.say("nothing to redo")

    def _plan(self) -> None:
        """Show what `map` would write; of a file, to each of its nodes."""
        file = self._file
        if file is None:
            changed = self.pdos.changed()
            edited = {self.node.node_id: Edited(self.node, self.pdos.held, changed)} if changed else {}
        else:
            edited = dict(file.edited())
        if not edited:
            links = f": {join_some(left)} changes no PDO" if (left := self._changes()) else self._no_change()
            self.say(f"nothing to plan{links}")
            return

        def work() -> str:
            titles = None if file is None else dict(file.nodes)
            self._dialogs.append(plan_dialog(self._session, edited, self._columns, titles))
            return ""

        self.beside.start("plan", work)

    def _no_change(self) -> str:
        return f": the {'node' if self._file is None else 'file'} already has these values"

    def _apply(self) -> None:
        if not self._changes():
            self.say(f"nothing to {'apply' if self._file is None else 'write'}{self._no_change()}")
            return
        self._end(APPLY)

    def _shown_changes(self) -> list[str]:
        """Return the changed PDOs in words; those of a file's other nodes, and links, with their nodes."""
        own = [pdo.label for pdo in self.pdos.changed()]
        file = self._file
        return own if file is None else [
            *own, *(change for change in file.changed() if not change.startswith(f"{self.node.node_id}:"))
        ]  # fmt: skip

    def _changes(self) -> Sequence[str]:
        """Return the changed PDOs in words, of all nodes of a file."""
        return [pdo.label for pdo in self.pdos.changed()] if self._file is None else self._file.changed()

    def _press_of_nodes(self, text: str) -> None:
        """Take a key for a file with several nodes."""
        if not self.view.has_nodes:
            self.say(f"{text} needs a network file with several nodes: dvtcli edit FILE", bad=True)
        else:
            _OF_NODES[text](self)

    def _link(self) -> None:
        """Choose an RPDO of another node, and let it receive the chosen TPDO."""
        pdo, file = self.view.pdo, self._file
        if file is None or not pdo.is_tpdo:
            self.say(f"{pdo.label} is an RPDO: choose a TPDO with up and down, then L links an RPDO to it", bad=True)
            return

        def made(said: str, is_bad: bool) -> None:
            self._judged = None
            self.say(said, bad=is_bad)

        LinkDialogs(file, Endpoint(self.node.node_id, pdo), self._dialogs.append, made).choose_consumer()

    def _choose_node(self) -> None:
        """Choose another node of the file."""
        if self._file is None:
            return
        nodes = self._file.nodes

        def done(number: int) -> None:
            self.next_node = nodes[number][0]
            self._end(NODE)

        rows = [(str(number % 10) if number < 10 else " ", f"{node_id} {name}")
                for number, (node_id, name) in enumerate(nodes, 1)]  # fmt: skip
        self._dialogs.append(Choices("which node?", rows, done))

    def _save(self) -> None:
        def done(file: str) -> str:
            if not file:
                return "a file name"
            try:
                refuse_suffix(file)
            except UsageError as wrong:
                return wrong.text
            changed = self.pdos.changed()

            def work() -> str:
                whole = None if self._file is None else self._file.save(self._session, file)
                said = whole or save_edited(self._session, self.node, self.pdos.held, changed, file)
                is_dry = self._session.dry_run if self._file is None else self._file.dry_run
                return f"{said}; dry run: only this file was written" if is_dry else said

            self.beside.start("save", work)
            return ""

        self._ask("save as", "pdos.dvt", done, ".dvt a script of the changes; .yaml .yml .dcf .xdc the node with them")

    def _show_findings(self) -> None:
        """Show all findings of the rules, of all nodes of a file."""
        found = self.view.every_finding()
        if self.view.findings is None or not found:
            self.say("the rules are being asked" if self.view.findings is None else "the rules have no findings")
            return
        lines = [[Cell(part, style)] for line, style in found for part in broken(line, max(8, self._columns))]
        self._dialogs.append(TextDialog("FINDINGS", lines))

    def _help(self) -> None:
        """Show the list of all keys."""
        wide = max(len(key) for key, _ in ALL_KEYS)
        lines = [[Cell(f"  {key:<{wide}}  ", "bold"), Cell(does)] for key, does in ALL_KEYS]
        self._dialogs.append(TextDialog("KEYS", lines, "f1"))

    def _leave(self) -> None:
        """Leave; with changes after a question."""
        changed = self._changes()
        if not changed:
            self._end(LEAVE)
            return

        def answered(answer: bool) -> None:
            if answer:
                self._end(LEAVE)

        done = "applied" if self._file is None else "written"
        self._dialogs.append(Question(f"{join_some(changed)} changed and not {done}: leave without?", answered))

    def _end(self, outcome: str) -> None:
        self.outcome = outcome
        application = get_app()
        if application.is_running and not application.is_done:
            application.exit()


_OF_NODES: Mapping[str, Callable[[Editor], None]] = {
    "n": Editor._choose_node,  # noqa: SLF001
    "L": Editor._link,  # noqa: SLF001
}
_ALWAYS: Mapping[str, Callable[[Editor], None]] = {
    "tab": lambda editor: editor._next_pane(1),  # noqa: SLF001
    "s-tab": lambda editor: editor._next_pane(-1),  # noqa: SLF001
    "f1": Editor._help,  # noqa: SLF001
    "f5": Editor._plan,  # noqa: SLF001
    "f10": Editor._apply,  # noqa: SLF001
    "c-s": Editor._apply,  # noqa: SLF001
    "f2": Editor._save,  # noqa: SLF001
    "c-z": Editor._undo,  # noqa: SLF001
    "c-y": Editor._redo,  # noqa: SLF001
    "escape": Editor._leave,  # noqa: SLF001
    "c-c": Editor._leave,  # noqa: SLF001
}
