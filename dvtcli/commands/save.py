"""Save this session's changes as a script that runs."""

from __future__ import annotations

import os
import shlex
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dvtcli.device.read import read_identity
from dvtcli.domain.several import several
from dvtcli.errors import UsageError
from dvtcli.params import FILE
from dvtcli.shell import DvtCommand, split

if TYPE_CHECKING:
    from dvtcli.results import Facts
    from dvtcli.session import Session


@click.command("save", cls=DvtCommand, short_help=__doc__)
@click.argument("file", type=FILE)
@click.pass_obj
def command(session: Session, /, file: str) -> Facts:
    """Write what succeeded and changed something to FILE; its first line pins the node's identity.

    \b
    save tpdo1.dvt
    save tpdo1.tcl             the same for Tcl
    """
    from dvtcli.results import Facts

    path = Path(file)
    if not session.executed:
        raise UsageError("nothing to save: this session changed nothing")
    if os.path.exists(path):  # noqa: PTH110 - Path.exists raises OSError for a name that is too long
        session.consent(f"{file} exists; overwrite it?")
    text, identity = _script(session)
    if file.lower().endswith(".tcl"):
        text = _as_tcl(text)
    try:
        _write(path, text)
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror}", place=file) from failed
    count = len(session.executed)
    said = f"{file}: {count} command{'' if count == 1 else 's'} for {identity}. Run it: dvtcli run {shlex.quote(file)}"
    return Facts("save", (("file", file), ("commands", count)), (said,))


def _script(session: Session) -> tuple[str, str]:
    """The script's text, and the identities that it pins.

    Lines about one node that is selected anyway fit any node of that kind; others say which node they are about.
    """
    node_ids = list(dict.fromkeys(node_id for node_id, _ in session.executed))
    named = len(node_ids) > 1 or node_ids[0] != _default_id(session)
    pins = {node_id: _pin(session, node_id) for node_id in node_ids}
    lines = ["# dvtcli script 1"]
    current = None
    for node_id, line in session.executed:
        if node_id != current:
            lines += [f"node {node_id}"] if named else []
            lines += pins[node_id][0]
            current = node_id
        lines.append(line)
    shown = [f"node {node_id} ({pins[node_id][1]})" if named else pins[node_id][1] for node_id in node_ids]
    return "\n".join([*lines, ""]), several(shown)


def _as_tcl(text: str) -> str:
    """A script's lines for Tcl, where `dvtcli` stands before each; words that Tcl would read otherwise get braces."""
    head, *lines = text.splitlines()
    shown = [" ".join(["dvtcli", *map(_tcl_word, split(line))]) for line in lines if line]
    return "\n".join([head, *shown, ""])


def _tcl_word(word: str) -> str:
    return word if word and not set(word) & set(' \t"[]{}$;#\\') else f"{{{word}}}"


def _default_id(session: Session) -> int | None:
    try:
        return session.default_id()
    except UsageError:
        return None


def _pin(session: Session, node_id: int) -> tuple[list[str], str]:
    """The line that requires a node's identity, none where it has none, and the identity for people."""
    sdo = session.node(node_id).sdo
    vendor, product = (read_identity(sdo, sub_index) for sub_index in (1, 2))
    if vendor is None:
        return [], "any node"
    if product is None:
        return [f"require identity vendor=0x{vendor:08X}"], f"vendor 0x{vendor:X}"
    words = f"vendor=0x{vendor:08X} product=0x{product:08X}"
    return [f"require identity {words}"], f"vendor 0x{vendor:X} product 0x{product:08X}"


def _write(path: Path, text: str) -> None:
    """Write the file whole or not at all."""
    with tempfile.NamedTemporaryFile("w", dir=path.parent, delete=False, encoding="utf-8", newline="\n") as file:
        file.write(text)
    try:
        os.replace(file.name, path)  # noqa: PTH105 - atomic on every platform
    except OSError:
        os.unlink(file.name)  # noqa: PTH108 - beside the line above
        raise
