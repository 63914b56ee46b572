"""Run a script: every line is parsed before the first one runs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dvtcli.params import FILE
from dvtcli.shell import DvtCommand

if TYPE_CHECKING:
    from dvtcli.session import Session


@click.command("run", cls=DvtCommand, short_help=__doc__)
@click.argument("file", type=FILE)
@click.option("--keep-going", is_flag=True, help="Run on after a failing line; end with the first failure's code.")
@click.pass_obj
def command(session: Session, /, file: str, keep_going: bool) -> int:
    """Run the commands in FILE, or of stdin with `-`.

    \b
    run scripts/pdo_config.dvt
    run setup.dvt --dry-run
    """
    return run_file(session, file, keep_going=keep_going)


def run_file(session: Session, file: str, *, keep_going: bool = False) -> int:
    """Run the script *file*, stdin with `-`; the exit code. UsageError where it cannot be read."""
    from dvtcli.errors import UsageError
    from dvtcli.script import MOST_BYTES, run_script

    if file == "-":
        return run_script(session, sys.stdin.buffer.read(MOST_BYTES + 1), "<stdin>", keep_going=keep_going)
    try:
        with Path(file).open("rb") as script:
            data = script.read(MOST_BYTES + 1)
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror}", place=file, hint="run takes the path of a script") from failed
    return run_script(session, data, file, keep_going=keep_going)
