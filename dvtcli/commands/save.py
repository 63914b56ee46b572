"""Save this session's changes as a script that runs."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dvtcli.params import FILE
from dvtcli.shell import DvtCommand

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
    """
    from dvtcli.errors import UsageError
    from dvtcli.results import Facts

    path = Path(file)
    if not session.executed:
        raise UsageError("nothing to save: this session changed nothing")
    if os.path.exists(path):  # noqa: PTH110 - Path.exists raises OSError for a name that is too long
        session.consent(f"{file} exists; overwrite it?")
    text, identity = _script(session)
    try:
        _write(path, text)
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror}", place=file) from failed
    count = len(session.executed)
    said = f"{file}: {count} command{'' if count == 1 else 's'} for {identity}. Run it: dvtcli run {file}"
    return Facts("save", (("file", file), ("commands", count)), (said,))


def _script(session: Session) -> tuple[str, str]:
    """The script's text, and the identity that it pins."""
    from dvtcli.device.read import read_optional

    sdo = session.node().sdo
    vendor, product = (read_optional(sdo, 0x1018, sub_index, 4) for sub_index in (1, 2))
    lines = ["# dvtcli script 1"]
    identity = "any node"
    if vendor is not None:
        identity = f"vendor 0x{vendor:X}"
        words = [f"require identity vendor=0x{vendor:08X}"]
        if product is not None:
            words.append(f"product=0x{product:08X}")
            identity += f" product 0x{product:08X}"
        lines.append(" ".join(words))
    return "\n".join([*lines, *session.executed, ""]), identity


def _write(path: Path, text: str) -> None:
    """Write the file whole or not at all."""
    with tempfile.NamedTemporaryFile("w", dir=path.parent, delete=False, encoding="utf-8", newline="\n") as file:
        file.write(text)
    try:
        os.replace(file.name, path)  # noqa: PTH105 - atomic on every platform
    except OSError:
        os.unlink(file.name)  # noqa: PTH108 - beside the line above
        raise
