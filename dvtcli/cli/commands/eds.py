"""Check, show and convert EDS, DCF, XDD and XDC files; keep a library of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands._frame_options import dbc_options
from dvtcli.cli.params import FILE, TEXT, CanopenType
from dvtcli.domain.datatypes import parse_number
from dvtcli.errors import UsageError
from dvtcli.operations.user.options import SPECIAL_FORMATS

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.exchange.export_dbc import DbcOptions
    from dvtcli.operations.results import Facts, FileReport, FileReports, LibraryAdded, LibraryListing
    from dvtcli.operations.user.session_user import SessionUser


@dataclass(frozen=True, slots=True)
class Conversion:
    """The *node* of a network file, by name or node-ID, options for a DBC file, and whether an EDS is *plain*."""

    node: str | None
    options: DbcOptions
    plain: bool

    def refuse(self) -> None:
        """Raise UsageError if any option is given, for use with other actions."""
        if self.node is not None:
            raise UsageError("--for belongs to eds convert", hint="eds convert net.yaml node5.cdcf --for 5")
        if self.plain:
            raise UsageError("--plain belongs to eds convert", hint="eds convert drive.eds plain.eds --plain")
        if self.options:
            text = "--with, --split-bits and --all belong to eds convert"
            raise UsageError(text, hint="eds convert net.yaml net.dbc --all")


def convert_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--for`, `--plain` and the options of a DBC file, as one *conversion*."""

    @dbc_options
    @wraps(command)
    def with_conversion(*values: Any, node: str | None, options: DbcOptions, plain: bool, **others: Any) -> Any:
        return command(*values, conversion=Conversion(node, options, plain), **others)

    help_ = "convert: the node of a network file, name or node-ID."
    with_node = click.option("--for", "node", type=TEXT, metavar="NODE", help=help_)(with_conversion)
    help_ = "convert: an EDS or DCF without units, modules and safety keys, which some tools refuse."
    return click.option("--plain", is_flag=True, help=help_)(with_node)


_IDENTITY = ("vendor", "product", "revision")
_ACTIONS = ("check", "show", "add", "list", "remove", "prefer", "convert")


class IdentityType(CanopenType):
    """A device's identity, `vendor=0x1E,product=0x0705302D,revision=0x00030000`."""

    name = "identity"

    def parse(self, text: str, ctx: click.Context | None) -> dict[str, int]:  # noqa: ARG002 - a type of click
        """Return the numbers by name. Raises ValueError if malformed."""
        found = {}
        for pair in text.replace(",", " ").split():
            name, equals, number = pair.partition("=")
            if not equals or name not in _IDENTITY:
                raise ValueError(f"{pair!r}: write vendor=…,product=… and, if it matters, revision=…")
            found[name] = parse_number(number)
            if not 0 <= found[name] <= 0xFFFF_FFFF:
                raise ValueError(f"{pair}: it has 32 bits")
        return found


@click.command(
    "eds", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE, needs_settings=False, formats=SPECIAL_FORMATS
)
@click.argument("action", type=click.Choice(_ACTIONS), metavar="|".join(_ACTIONS))
@click.argument("files", type=FILE, nargs=-1, metavar="[FILE...]")
@click.option("--rule", "only", multiple=True, metavar="NAME", help="check: this rule only; repeatable.")
@click.option("--without", multiple=True, metavar="NAME", help="check: skip this rule; repeatable.")
@click.option("--strict", is_flag=True, help="check: treat warnings as errors.")
@click.option(
    "--identity", type=IdentityType(), metavar="vendor=…,product=…", help="add: keep FILE for nodes of this identity."
)
@click.pass_obj
@convert_options
def command(
    session: Conversation,
    /,
    action: str,
    files: tuple[str, ...],
    only: tuple[str, ...],
    without: tuple[str, ...],
    strict: bool,
    identity: dict[str, int] | None,
    conversion: Conversion,
) -> Facts | FileReport | FileReports | LibraryAdded | LibraryListing:
    """Read FILE and show its content; `check` lists all its errors, with their lines, also of several files.

    `check` ends with exit code 4 if a rule found an error. --format github, junit or sarif is for CI; -p checks the
    PDOs as on a device of that family. `add` keeps files, the files of a folder, or a family's file: then nodes of
    that vendor, product and revision (0x1018) use them; `list`, `remove` and `prefer` manage the library. `convert IN
    OUT` writes the format of OUT's suffix, and lists lost content. A concise DCF (0x1F22, .cdcf) can be shown, and
    made of a network file for one node. A DBC file is made of all nodes of a network file, or of the nodes whose
    COB-IDs and mappings are in a recording's SDO transfers (names: --eds, or the recorded identity).

    \b
    eds check drive.eds
    eds check drive.eds --strict --without no-dummy-usage
    eds check drive.eds --rule pdo-length --format github
    eds check *.eds
    eds show drive.eds
    eds add drive.eds       found from now on by the node's identity
    eds add eds-files/      all files of a folder and its subfolders
    eds add gen4            the EDS of a simulated family
    eds add bare.eds --identity vendor=0x1E,product=0x0705302D
    eds list
    eds prefer drive.eds    before others of its identity
    eds remove drive.eds
    eds convert drive.eds drive.xdd
    eds convert press.dcf press.xdc
    eds convert coupler.eds coupler.dcf --modules 1,1,2    of a modular device, with its modules
    eds convert drive.eds plain.eds --plain    for dcfgen and other strict readers
    eds convert press.yaml ram.cdcf --for ram
    eds convert press.dcf press.cdcf
    eds convert press.yaml press.dbc
    eds convert press.yaml press.dbc --with sync,emcy
    eds convert setup.log press.dbc    the PDOs in a recording
    eds show ram.cdcf
    """
    asks_rules = bool(only or without or strict or session.output.format in SPECIAL_FORMATS)
    _refuse_options(action, identity, conversion, asks_rules=asks_rules)
    if not files and action != "list":
        raise click.UsageError("Missing argument '[FILE...]'.")
    if action == "check":
        from dvtcli.operations.devices.eds_files import check_eds

        return check_eds(
            files, only, without, strict=strict, family=session.options.profile, modules=session.options.chosen_modules
        )
    if action == "convert":
        return _convert(session, files, conversion)
    return _show(session, _one(action, files)) if action == "show" else _library(session, action, files, identity)


def _refuse_options(action: str, identity: dict[str, int] | None, conversion: Conversion, *, asks_rules: bool) -> None:
    """Raise UsageError for an option of another *action*."""
    if action != "convert":
        conversion.refuse()
    if identity is not None and action != "add":
        raise UsageError("--identity belongs to eds add", hint="eds add drive.eds --identity vendor=0x1E,product=5")
    if asks_rules and action != "check":
        hint = f"--rule, --without, --strict and --format {' | '.join(SPECIAL_FORMATS)} belong to eds check"
        raise UsageError(f"eds {action} checks no rules", hint=hint)


def _one(action: str, files: tuple[str, ...]) -> str:
    if len(files) > 1:
        raise UsageError(
            f"eds {action} takes one file", hint=f"{len(files)} were given; only eds check takes several files"
        )
    return files[0]


def _library(
    session: SessionUser, action: str, files: tuple[str, ...], identity: dict[str, int] | None
) -> LibraryAdded | LibraryListing:
    from dvtcli.operations.devices.eds_library import list_files, prefer_file, remove_files

    if action == "add":
        from dvtcli.operations.devices.eds_library import add_files

        return add_files(session, files, identity)
    if action == "remove":
        return remove_files(session, files)
    if action == "prefer":
        return prefer_file(session, _one(action, files))
    if files:
        raise UsageError("eds list takes no file", hint="eds show FILE shows the contents of a file")
    return list_files(session)


def _convert(session: Conversation, files: tuple[str, ...], conversion: Conversion) -> Facts:
    from dvtcli.operations.exchange.convert_file import convert_file

    if len(files) != 2:
        raise UsageError("eds convert takes two files", hint="eds convert drive.eds drive.xdd")
    return convert_file(session, *files, conversion.node, conversion.options, plain=conversion.plain)


def _show(session: SessionUser, file: str) -> Facts:
    from dvtcli.domain.network.concise_dcf import SUFFIX
    from dvtcli.operations.devices.eds_files import show_eds

    if not file.lower().endswith(SUFFIX):
        return show_eds(file, session.options.chosen_modules)
    from dvtcli.operations.network.concise_network import show_concise
    from dvtcli.operations.session.device_files import offline_dictionaries

    known = offline_dictionaries(session.options)
    return show_concise(file, known[0][0] if known else None)
