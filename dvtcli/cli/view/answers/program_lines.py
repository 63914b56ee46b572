"""The text of a program that was loaded into a device."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.cli.view.lines import Cell, Line

if TYPE_CHECKING:
    from dvtcli.operations.results.programs import ProgramLoaded


def program_lines(result: ProgramLoaded, _width: int) -> Iterator[Line]:
    """What runs now, and by what that is known."""
    what = f"program {result.number} of node {result.node}"
    if result.dry_run:
        new = f"load {result.file} ({result.size:,} bytes) and start it"
        yield [Cell("dry run: ", "cyan"), Cell(f"would stop and clear {what}, {new}. Nothing was sent.")]
        return
    seen = "its boot-up message was heard" if result.restarted else "it says so; no boot-up message was heard"
    yield f"{what}: {result.file}, {result.size:,} bytes in {result.seconds:.1f} s, runs: {seen}"
    yield f"  0x1F56 says {_said(result.after)} (before: {_said(result.before)}){_compared(result)}"


def _said(identification: int | None) -> str:
    return "nothing" if identification is None else f"0x{identification:08X}"


def _compared(result: ProgramLoaded) -> str:
    if result.expected is None:
        return ": compared with nothing, --expect does that"
    return f", as profile {result.expected_by} expects" if result.expected_by else ", as expected"
