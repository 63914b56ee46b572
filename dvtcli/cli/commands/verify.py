"""Read PDOs back and compare with what this session set, or with a FILE; --frame looks at a real frame."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.params import PDO, TEXT, NodePdo
from dvtcli.cli.ways import Ways, ways
from dvtcli.errors import UsageError
from dvtcli.operations.compare_pdos import SESSION, compare, dcf_wish
from dvtcli.operations.options import is_file

if TYPE_CHECKING:
    from dvtcli.device.wish import Wish
    from dvtcli.domain.pdo import Pdo
    from dvtcli.operations.results import Compared, ComparedNodes
    from dvtcli.operations.session import Session


@click.command("verify", cls=DvtCommand, short_help=__doc__)
@click.argument("words", type=TEXT, nargs=-1, metavar="[PDO...] [FILE]")
@click.option("--frame", is_flag=True, help="Start the node and look at a frame of each enabled TPDO.")
@click.pass_context
def command(ctx: click.Context, /, words: tuple[str, ...], frame: bool) -> Compared | ComparedNodes:
    """Compare what the nodes hold now; exit code 3 where it differs, 1 where no frame came.

    FILE is a script (what its lines would set), or a DCF or EDS.

    \b
    verify                   everything this session changed, on every node
    verify tpdo1 --frame
    verify tpdo1 press.dcf
    verify press.dvt         what a script would set
    """
    from dvtcli.operations.results import ComparedNodes

    session: Session = ctx.obj
    pdos, file = _sorted_words(words)
    wishes = _chosen(session, pdos, _wishes(session, ways(ctx), pdos, file), file or SESSION)
    named = len(wishes) > 1 or len(session.known_ids()) > 1
    compared = tuple(
        compare(session, session.node(node_id), wish, file, frame=frame, named=named)
        for node_id, wish in wishes.items()
    )
    return compared[0] if len(compared) == 1 else ComparedNodes(compared)


def _wishes(session: Session, lines: Ways, pdos: list[NodePdo], file: str | None) -> dict[int, Wish]:
    """What should be on each node, by *file* or by what this session set."""
    from dvtcli.device.wish import session_wish

    if file is None:
        return {node_id: session_wish(node) for node_id, node in sorted(session.network.nodes.items())}
    if _is_script(file):
        return lines.rehearsed(session, file)
    named = {pdo.node_id for pdo in pdos if pdo.node_id is not None}
    if len(named) > 1:
        raise UsageError("a DCF is about one node: use one line for each node")
    node = session.node(named.pop() if named else None)
    return {node.node_id: dcf_wish(node, file)}


def _is_script(file: str) -> bool:
    if file.lower().endswith(".tcl"):
        raise UsageError(
            f"{file}: what a Tcl script sets is not known before it runs",
            place=file,
            hint="run it, then `verify` compares with what it set; or `save FILE.dvt` and compare with that",
        )
    if file.lower().endswith(".dvt"):
        return True
    try:
        with Path(file).open("rb") as opened:
            return opened.read(32).lstrip(b"\xef\xbb\xbf").startswith(b"# dvtcli script")
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror}", place=file) from failed


def _chosen(session: Session, pdos: list[NodePdo], wishes: dict[int, Wish], against: str) -> dict[int, Wish]:
    """The part of *wishes* that is about *pdos* (none: everything); UsageError where nothing is left to compare."""
    wished = {node_id: wish for node_id, wish in wishes.items() if wish}
    if not wished:
        said = "this session changed nothing" if against == SESSION else f"{against} sets nothing"
        raise UsageError(
            f"nothing to compare: {said}",
            hint="verify FILE compares with a script, a DCF or an EDS; map or set something first",
        )
    asked: dict[int, list[Pdo]] = {}
    for word in pdos:
        asked.setdefault(session.node_id() if word.node_id is None else word.node_id, []).append(word.pdo)
    for node_id, wanted in asked.items():
        missing = [pdo for pdo in wanted if node_id not in wished or pdo not in wished[node_id].pdos]
        if missing:
            what = f"{missing[0].label} of node {node_id}" if len(session.known_ids()) > 1 else missing[0].label
            said = f"this session did not set {what}" if against == SESSION else f"{against} says nothing of {what}"
            raise UsageError(said, hint="verify FILE compares with a script, a DCF or an EDS; map or set it first")
    return {node_id: wished[node_id].only(wanted) for node_id, wanted in sorted(asked.items())} or wished


def _sorted_words(words: tuple[str, ...]) -> tuple[list[NodePdo], str | None]:
    """PDOs and the file among *words*; more than one file, or a word that is neither, is a usage error."""
    pdos: list[NodePdo] = []
    files: list[str] = []
    for word in words:
        if is_file(word):
            files.append(word)
            continue
        try:
            pdos.append(PDO.parse(word, None))
        except ValueError as wrong:
            raise UsageError(f"{word!r} is neither a PDO nor a file") from wrong
    if len(files) > 1:
        raise UsageError("verify compares with one file at a time")
    return pdos, files[0] if files else None
