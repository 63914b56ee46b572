"""Read PDOs back and compare with what this session set, or with a DCF; --frame looks at a real frame."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dvtcli.errors import UsageError
from dvtcli.options import is_file
from dvtcli.params import TEXT
from dvtcli.shell import DvtCommand

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.results import Compared
    from dvtcli.session import Session


@click.command("verify", cls=DvtCommand, short_help=__doc__)
@click.argument("words", type=TEXT, nargs=-1, metavar="[PDO...] [FILE]")
@click.option("--frame", is_flag=True, help="Start the node and look at a frame of each enabled TPDO.")
@click.pass_obj
def command(session: Session, /, words: tuple[str, ...], frame: bool) -> Compared:
    """Compare the PDOs as the node holds them now; exit code 3 where they differ.

    \b
    verify                   everything this session changed
    verify tpdo1 --frame
    verify tpdo1 press.dcf   against a file
    """
    from dvtcli.commands._frames import look
    from dvtcli.device.compare import differences
    from dvtcli.results import Compared

    node = session.node()
    pdos, files = _sorted_words(words)
    wanted = dcf_configs(node, files[0]) if files else node.wanted
    chosen = pdos or list(wanted)
    missing = [pdo for pdo in chosen if pdo not in wanted]
    if missing:
        what = f"{files[0]} says nothing of" if files else "this session did not set"
        raise UsageError(f"{what} {missing[0].label}", hint="verify FILE compares with a DCF; map or set it first")
    found = tuple((pdo.label, text) for pdo in chosen for text in differences(pdo, wanted[pdo], node.pdo(pdo)))
    if not files:
        _judge(node, chosen, differs=bool(found))
    frames, note = look(session, node, [pdo for pdo in chosen if pdo.is_tpdo]) if frame else ((), "")
    against = files[0] if files else "this session's changes"
    count = sum(5 + len(wanted[pdo].mapping) for pdo in chosen)
    return Compared(node.node_id, len(chosen), count, found, against, frames, note)


def _judge(node: Node, chosen: list[Pdo], *, differs: bool) -> None:
    """A difference forbids to store; only a look at everything this session set, without one, allows it again."""
    from dvtcli.device.pending import REBOOT, VERIFY

    suspicions = node.pending.suspicions
    if differs:
        suspicions[VERIFY] = "verify found differences to what this session set"
    elif set(node.wanted) <= set(chosen):
        suspicions.pop(VERIFY, None)
        suspicions.pop(REBOOT, None)


def _sorted_words(words: tuple[str, ...]) -> tuple[list[Pdo], list[str]]:
    """PDOs and files among *words*; more than one file, or a word that is neither, is a usage error."""
    from dvtcli.domain.pdo import Pdo

    pdos: list[Pdo] = []
    files: list[str] = []
    for word in words:
        if is_file(word):
            files.append(word)
            continue
        try:
            pdos.append(Pdo.parse(word))
        except ValueError as wrong:
            raise UsageError(f"{word!r} is neither a PDO nor a file") from wrong
    if len(files) > 1:
        raise UsageError("verify compares with one file at a time")
    return pdos, files


def dcf_configs(node: Node, file: str) -> dict[Pdo, PdoConfig]:
    """The PDOs as a DCF (or an EDS's defaults) sets them on this node."""
    from dvtcli.device.read import present_pdos, read_pdo
    from dvtcli.formats.eds import read_eds
    from dvtcli.formats.eds_values import FileValues

    dictionary = read_eds(Path(file)).dictionary
    values = FileValues(dictionary, node.node_id)
    return {pdo: read_pdo(values, pdo) for pdo in present_pdos(values, dictionary)}
