"""Update a device's firmware (program download, CiA 302-3) and check that it runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand, Effect, Final
from dvtcli.cli.params import FILE, CanopenType, NumberType
from dvtcli.domain.datatypes import parse_number
from dvtcli.operations.user.refused_options import refuse_options

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts, ProgramLoaded
    from dvtcli.operations.session.session import Session


class _ExpectType(CanopenType):
    """A software identification: a 32-bit number, or `crc32` for the checksum of the file."""

    name = "identification"

    def parse(self, text: str, ctx: click.Context | None) -> int | str:  # noqa: ARG002 - click's interface
        """The number, or the word; ValueError."""
        if text.lower() == "crc32":
            return "crc32"
        number = parse_number(text)
        if not 0 <= number <= 0xFFFF_FFFF:
            raise ValueError(f"{text}: 0…0xFFFFFFFF, or crc32")
        return number


def _final(params: Mapping[str, Any]) -> Final | None:
    """No `undo` restores a cleared program."""
    return None if params["forget"] else Final("download")


@click.command("download", cls=DvtCommand, short_help=__doc__, effect=Effect.COMMANDS, final=_final)
@click.argument("file", type=FILE, required=False)
@click.option("--program", type=NumberType(1, 254, "a program"), metavar="N", help="Number of the program [1].")
@click.option("--expect", type=_ExpectType(), metavar="ID|crc32", help="Expected value of 0x1F56 [the profile's].")
@click.option("--forget", is_flag=True, help="Stop reporting an interrupted download.")
@click.pass_obj
def command(
    session: Session, /, file: str | None, program: int | None, expect: int | str | None, forget: bool
) -> ProgramLoaded | Facts:
    """Load FILE (.bin .hex) as the node's program.

    The old program is stopped and cleared; the new one is sent, checked by the device's flash status and software
    identification, started, and checked to run. It asks first: the old program cannot be restored once it is cleared. A
    failure has the state of the device. A download that was interrupted is reported whenever the node is used.

    \b
    download fw.bin
    download fw.hex --expect 0xAA58267D
    download fw.bin --expect crc32 --program 2
    download --forget
    """
    from dvtcli.operations.nodes.load_program import forget_download, load_program

    if forget == (file is not None):
        raise click.UsageError("name a file (.bin .hex), or --forget alone")
    if file is None:
        refuse_options({"program": program, "expect": expect}, "not with --forget, which loads no program")
        return forget_download(session)
    return load_program(session, file, number=1 if program is None else program, expect=expect)
