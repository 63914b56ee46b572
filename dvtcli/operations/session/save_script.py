"""Save a session's changes, or what nodes hold, as a runnable script with the nodes' identities."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import read_identity
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.plan import PdoChange
from dvtcli.domain.script_line import backup_lines, end_state, left_out_stores, touched
from dvtcli.domain.text import join_some
from dvtcli.errors import UsageError
from dvtcli.operations.results import Facts
from dvtcli.operations.session.whole_file import reader_of, write_whole

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.pdo import Pdo
    from dvtcli.operations.session.session import Session, SessionNodes
    from dvtcli.operations.session.whole_file import ReadBack
    from dvtcli.operations.user.session_user import SessionUser

#: Consecutive lines about a node.
Section = tuple[int, list[str]]


class SavedSession(Enum):
    """The part of a session to save."""

    ENDS = "what its changes come to"
    STEPS = "every step in order"
    EVERYTHING = "the complete configuration of the nodes' PDOs"


ENDS, STEPS, EVERYTHING = SavedSession


def script_text(session: Session, what: SavedSession = ENDS) -> str:
    """Return *what* of this session as a runnable script; raises UsageError if there is nothing to save."""
    return _script(session, _SECTIONS[what](session))[0]


def script_of(session: SessionNodes, node_id: int) -> str:
    """Return all PDOs of the node with *node_id* as a runnable script."""
    return _script(session, _held(session, [node_id]))[0]


def script_of_lines(session: SessionNodes, node_id: int, lines: list[str]) -> str:
    """Return *lines* about the node with *node_id* as a runnable script."""
    return _script(session, [(node_id, lines)])[0]


def save_script(
    session: Session,
    file: str,
    what: SavedSession = ENDS,
    spelled: Callable[[str], str] | None = None,
    read_back: ReadBack | None = None,
) -> Facts:
    """Write *what* of this session to *file*, whole or not at all; *spelled* translates the text.

    *read_back* reads a script like `run`.

    Asks before overwriting. Raises UsageError if there is nothing to save or the file cannot be written.
    """
    path = place_of(file)
    sections = _SECTIONS[what](session)
    ask_before_overwriting(session, path)
    text, identity = _script(session, sections)
    make_file(session, path, text if spelled is None else spelled(text), read_back)
    count = sum(not line.startswith("#") for _, lines in sections for entry in lines for line in entry.splitlines())
    said = Hint(
        Action.RUN,
        {"file": file},
        f"{verbatim(file)}: {count} command{'' if count == 1 else 's'} for {verbatim(identity)}. Run it: {{}}",
    )
    return Facts("save", (("file", file), ("commands", count)), (said,))


def place_of(file: str, example: str = "NAME.dvt") -> Path:
    """Return the path of *file*; raises UsageError for a folder or a missing folder, with *example* as a hint."""
    path = Path(file)
    if os.path.isdir(path):  # noqa: PTH112 - Path.is_dir raises OSError for a name that is too long
        hint = f"give a file in it, such as {path / example}"
        raise UsageError(f"{file} is a folder", hint=hint)
    if not os.path.isdir(path.parent):  # noqa: PTH112
        raise UsageError(f"{file}: no such folder: {path.parent}", place=file)
    return path


def ask_before_overwriting(session: SessionUser, path: Path) -> None:
    """Ask for consent to overwrite *path*, if it exists."""
    if os.path.exists(path):  # noqa: PTH110 - Path.exists raises OSError for a name that is too long
        session.consent(f"{path} exists; overwrite it?")


def _steps(session: SessionNodes) -> list[Section]:
    """Return the changes in order; a node has a section for each run of changes."""
    if not session.record.lines:
        raise UsageError("nothing to save: this session changed nothing")
    sections: list[Section] = []
    for node_id, line in session.record.lines:
        if not sections or sections[-1][0] != node_id:
            sections.append((node_id, []))
        sections[-1][1].append(line)
    return sections


def ended_lines(session: SessionNodes) -> list[Section]:
    """Return the net changes of this session, a section per node; lists stores left out.

    Raises UsageError if there is no net change.
    """
    steps = _steps(session)
    node_ids = dict.fromkeys(node_id for node_id, _ in steps if node_id)
    found = {node_id: _end(session, node_id, [line for line_node, line in session.record.lines if line_node == node_id])
             for node_id in node_ids}  # fmt: skip
    sections = [(node_id, lines) for node_id, lines in found.items() if lines]
    if not sections:
        raise UsageError(
            "nothing to save: the changes of this session are reverted",
            hint=Hint(Action.SAVE_SCRIPT, {"history": True}, "writes each step"),
        )
    for node_id, lines in found.items():
        for store in left_out_stores([line for line_node, line in session.record.lines if line_node == node_id], lines):
            session.reporter.note(
                Hint(
                    Action.SAVE_SCRIPT,
                    {"history": True},
                    f"`{store}` of node {node_id} is left out: it stored what was before the last change; "
                    "{} writes each step",
                )
            )
    return sections


def _end(session: SessionNodes, node_id: int, lines: list[str]) -> list[str]:
    node = session.node(node_id)
    before = {
        change.pdo: change.before
        for plan in reversed(node.history)
        for change in reversed(plan.changes)
        if isinstance(change, PdoChange)
    }
    after = {pdo: node.wanted[pdo] if pdo in node.wanted else node.pdo(pdo) for pdo in sorted(touched(lines))}
    return end_state(lines, before, after)


def _everything(session: SessionNodes) -> list[Section]:
    """Return every PDO of changed nodes and the selected node, as now."""
    selected = session.selected_id()
    node_ids = {node_id for node_id, _ in session.record.lines if node_id} | (set() if selected is None else {selected})
    if not node_ids:
        session.node_id()  # says that none is selected
    return _held(session, sorted(node_ids))


def _held(session: SessionNodes, node_ids: Sequence[int]) -> list[Section]:
    nodes = [session.node(node_id) for node_id in node_ids]
    pdos = {node.node_id: node.pdos() for node in nodes}
    return [(node.node_id, backup_lines({}, pdos[node.node_id], _fixed(node))[1:]) for node in nodes]


def _fixed(node: ReadableNode) -> set[Pdo]:
    """Return the PDOs whose COB-ID is read-only by the EDS."""
    entries = (
        {pdo: node.dictionary.entry(pdo.communication_index, 1) for pdo in node.present()} if node.dictionary else {}
    )
    return {pdo for pdo, entry in entries.items() if entry is not None and not entry.access.writable}


def _script(session: SessionNodes, sections: list[Section]) -> tuple[str, str]:
    """Return the script's text and its pinned identities.

    Lines about the selected node alone fit any node of its kind; others name their node.
    """
    node_ids = list(dict.fromkeys(node_id for node_id, _ in sections if node_id))  # 0: commands to all nodes
    named = len(node_ids) > 1 or node_ids != [_default_id(session)]
    pins = {node_id: _pin(session, node_id) for node_id in node_ids}
    lines = ["# dvtcli script 1"]
    for node_id, section in sections:
        lines += [f"node {node_id}"] if named and node_id else []
        lines += [*(pins[node_id][0] if node_id else []), *section]
    shown = [f"node {node_id} ({pins[node_id][1]})" if named else pins[node_id][1] for node_id in node_ids]
    return "\n".join([*lines, ""]), join_some(shown) or "any node"


def _default_id(session: SessionNodes) -> int | None:
    try:
        return session.default_id()
    except UsageError:
        return None


def _pin(session: SessionNodes, node_id: int) -> tuple[list[str], str]:
    """Return the line that requires a node's identity, if it has one, and the identity in words."""
    sdo = session.node(node_id).sdo
    vendor, product = (read_identity(sdo, sub_index) for sub_index in (1, 2))
    if vendor is None:
        return [], "any node"
    if product is None:
        return [f"require identity vendor=0x{vendor:08X}"], f"vendor 0x{vendor:X}"
    words = f"vendor=0x{vendor:08X} product=0x{product:08X}"
    return [f"require identity {words}"], f"vendor 0x{vendor:X} product 0x{product:08X}"


def make_file(session: SessionUser, path: Path, content: str | bytes, read_back: ReadBack | None = None) -> None:
    """Write a file whole and readable, or not at all; records it in the session.

    *read_back* reads it back; None: the reader for its suffix. Raises UsageError if it cannot be written,
    InputFileError if it cannot be read back: an old file of that name stays.
    """
    data = content.encode() if isinstance(content, str) else content
    write_whole(path, data, read_back or reader_of(path))
    session.made.append(str(path))


_SECTIONS: dict[SavedSession, Callable[[Session], list[Section]]] = {
    ENDS: ended_lines,
    STEPS: _steps,
    EVERYTHING: _everything,
}
