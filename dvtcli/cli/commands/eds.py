"""Check, show or convert an EDS, DCF, XDD or XDC file, or add it to those that nodes are recognised by."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.effect import Effect
from dvtcli.cli.params import FILE, TEXT
from dvtcli.errors import UsageError
from dvtcli.operations.user.options import SPECIAL_FORMATS

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import Facts, FileReport, FileReports

TASK = ("Find nodes", 60)


@click.command(
    "eds", cls=DvtCommand, short_help=__doc__, effect=Effect.READS, needs_settings=False, formats=SPECIAL_FORMATS
)
@click.argument("action", type=click.Choice(["check", "show", "add", "convert"]), metavar="check|show|add|convert")
@click.argument("files", type=FILE, nargs=-1, required=True, metavar="FILE...")
@click.option("--rule", "only", multiple=True, metavar="NAME", help="check: this rule only; repeatable.")
@click.option("--without", multiple=True, metavar="NAME", help="check: all rules but this one; repeatable.")
@click.option("--strict", is_flag=True, help="check: exit code 4 for a warning, too.")
@click.option("--for", "node", type=TEXT, metavar="NODE", help="convert: the node of a network file, name or node-ID.")
@click.pass_obj
def command(
    session: Conversation,
    action: str,
    files: tuple[str, ...],
    only: tuple[str, ...],
    without: tuple[str, ...],
    strict: bool,
    node: str | None,
) -> Facts | FileReport | FileReports:
    """Read FILE and say what is in it; `check` names everything odd with its line, in several files, too.

    `check` ends with exit code 4 where a rule found an error. --format github, junit or sarif is for CI; -p judges the
    PDOs as on a device of that family. `convert IN OUT` writes the format that the name OUT ends in, and names all that
    it cannot hold. A concise DCF (0x1F22, .cdcf) is shown, and made of a network file for one of its nodes; a DBC file
    is made of all of them.

    \b
    eds check drive.eds
    eds check drive.eds --strict --without no-dummy-usage
    eds check drive.eds --rule pdo-length --format github
    eds check *.eds
    eds show drive.eds
    eds add drive.eds       found from now on by the node's identity
    eds convert drive.eds drive.xdd
    eds convert press.dcf press.xdc
    eds convert press.yaml ram.cdcf --for ram
    eds convert press.yaml press.dbc
    eds show ram.cdcf
    """
    from dvtcli.operations.known_devices import eds_files

    if node is not None and action != "convert":
        raise UsageError("--for belongs to eds convert", hint="eds convert net.yaml node5.cdcf --for 5")
    if action == "check":
        return eds_files.check_eds(files, only, without, strict=strict, family=session.options.profile)
    if only or without or strict or session.output.format in SPECIAL_FORMATS:
        hint = f"--rule, --without, --strict and --format {' | '.join(SPECIAL_FORMATS)} belong to eds check"
        raise UsageError(f"eds {action} asks no rules", hint=hint)
    if action == "convert":
        return _convert(session, files, node)
    if len(files) > 1:
        raise UsageError(f"eds {action} takes one file", hint=f"{len(files)} were given; eds check takes several")
    if action == "add":
        return eds_files.add_eds(files[0])
    return _show(session, files[0])


def _convert(session: Conversation, files: tuple[str, ...], node: str | None) -> Facts:
    from dvtcli.operations.exchange.convert_file import convert_file

    if len(files) != 2:
        raise UsageError("eds convert takes two files", hint="eds convert drive.eds drive.xdd")
    return convert_file(session, *files, node)


def _show(session: Conversation, file: str) -> Facts:
    from dvtcli.operations.exchange.convert_file import CONCISE_SUFFIX
    from dvtcli.operations.known_devices.eds_files import show_eds

    if not file.lower().endswith(CONCISE_SUFFIX):
        return show_eds(file)
    from dvtcli.operations.network.concise_network import show_concise
    from dvtcli.operations.opening.device_files import offline_dictionaries

    known = offline_dictionaries(session.options)
    return show_concise(file, known[0][0] if known else None)
