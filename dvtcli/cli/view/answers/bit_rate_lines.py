"""The text of `bitrate`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dvtcli.cli.view.lines import Cell, Line, Table

if TYPE_CHECKING:
    from dvtcli.operations.results.lss_nodes import BitRateFound


def bit_rate_lines(result: BitRateFound, width: int) -> Iterator[Line]:
    """Show the detected bit rate, and the frames received at each bit rate."""
    table = Table(("BIT/S", "FRAMES", "ERROR FRAMES"))
    for trial in result.heard:
        table.add(str(trial.bit_rate), str(trial.frames), str(trial.error_frames))
    yield from table.lines(width)
    if result.bit_rate is not None:
        yield [Cell(f"{result.bus} runs at {result.bit_rate} bit/s", "green"), Cell(f": -b {result.bit_rate}")]
        return
    yield [Cell(_nothing(result), "red")]
    yield [Cell(f"  {hint}", "dim") for hint in _hints(result)]


def _nothing(result: BitRateFound) -> str:
    at = "at none of the standard's bit rates" if result.complete else f"at {result.heard[0].bit_rate} bit/s"
    if result.silent:
        return f"{result.bus} is silent: no frame and no error frame {at}, {result.seconds:g} s each"
    if not any(trial.frames for trial in result.heard):
        return f"{result.bus}: something is sent, and {at} it can be read"
    return f"{result.bus}: frames come, and {at} without error frames"


def _hints(result: BitRateFound) -> Iterator[str]:
    if result.silent:
        yield (
            "a silent bus tells no bit rate: switch a node on while it is listened to, for it says boot-up; "
            "--for 5s; is the cable right?"
        )
    elif not any(trial.frames for trial in result.heard):
        yield "one node alone is never acknowledged, and cannot be read while we are silent: connect a second one"
    else:
        yield "nodes of two bit rates on one bus, or a bad line: take them off one by one"
