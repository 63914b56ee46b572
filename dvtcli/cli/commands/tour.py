"""Take a guided tour on a simulated node: each step is explained and carried out."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, NamedTuple

import click

from dvtcli.cli.boundary import LEAVE, exit_code_of, finish_line
from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.lexer import split
from dvtcli.cli.runner_interface import LineRunners, runners

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.view.output import Output


class TourStep(NamedTuple):
    """A step; *code* is 1 if the line demonstrates a refusal."""

    text: str
    line: str
    code: int = 0


STEPS = (
    TourStep("A PDO is a CAN frame that a node sends (TPDO) or takes (RPDO) by itself.\nThis node has some:", "pdo"),
    TourStep("Search the object dictionary for objects that fit a TPDO:", "objects velocity --mappable tpdo"),
    TourStep(
        "Map two objects into TPDO1, to be sent on every SYNC. dvtcli checks the\n"
        "whole plan first, then disables the PDO, writes, enables it, and reads back:",
        "map tpdo1 statusword velocity_actual_value --sync 1",
    ),
    TourStep("This is the frame now, byte by byte:", "pdo tpdo1"),
    TourStep(
        "A request that cannot work never reaches the node. The vendor-ID cannot be\n"
        "mapped, and the error has the abort code that the device would have sent:",
        "map tpdo1 6041 1018:1",
        1,
    ),
    TourStep("--dry-run tries a line on an exact twin of the node; nothing is written:", "clear tpdo2 --dry-run"),
    TourStep("Start the node and send a SYNC; the node transmits the frame:", "verify tpdo1 --frame --yes"),
    TourStep("So far it is in the node's RAM. Let it survive a reset, and prove that:", "store --prove"),
    TourStep("Undo the last change:", "undo"),
)


#: the family of the tour's node
_SHOWN = "generic"
_LEAVING = ("exit", "quit", "q")


@click.command("tour", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE, needs_settings=False)
@click.pass_context
def command(ctx: click.Context, /) -> int:
    """Explain dvtcli in a few steps on a simulated node of its own; no hardware is used.

    At a terminal Enter runs the line that is shown; anything else that you type runs, too. Ctrl-C, Ctrl-D or `exit`
    leaves. Without a terminal everything is printed.

    \b
    tour
    """
    from dvtcli.cli.conversation import Conversation

    session: Conversation = ctx.obj
    guide = Conversation(session.output)
    guide.start({"sim": (_SHOWN,), "color": session.base.color, "ascii": session.base.ascii})
    guide.started = True
    if session.is_open and not session.base.sim:
        _say(guide.output, "The tour uses its own simulated node: it sends nothing to the open bus.")
    asks = sys.stdin.isatty() and sys.stderr.isatty() and not session.in_script
    try:
        for number, step in enumerate(STEPS, 1):
            _say(guide.output, "", f"{number}/{len(STEPS)}  {step.text}")
            if not (_guided(guide, runners(ctx), step) if asks else _shown(guide, runners(ctx), step)):
                break
        else:
            _say(
                guide.output,
                "",
                "That was the tour. `help` has all commands; `dvtcli --sim generic` is a node for them.",
            )
    except KeyboardInterrupt:
        _say(guide.output, "", "The tour ends here.")
    finally:
        guide.close()
    return 0


def _guided(guide: Conversation, lines: LineRunners, step: TourStep) -> bool:
    """Let the user run the step's line, and others before it; returns False if the user leaves."""
    while True:
        _say(guide.output, f"  Enter runs:  {step.line}")
        guide.output.stderr.write("tour> ")
        guide.output.stderr.flush()
        typed = sys.stdin.readline()
        line = typed.strip()
        if not typed or line in _LEAVING:
            return False
        code = _run(guide, lines, line or step.line)
        if code == LEAVE:
            return False
        if not line or (line == step.line and code == step.code):
            return True


def _shown(guide: Conversation, lines: LineRunners, step: TourStep) -> bool:
    """Print the step's line and run it. Raises AssertionError if the exit code is not the step's."""
    guide.output.stdout.flush()
    _say(guide.output, f"tour> {step.line}")
    code = _run(guide, lines, step.line)
    assert code == step.code, step.line  # noqa: S101 - the tour is wrong then, and says so as a bug
    return True


def _run(guide: Conversation, lines: LineRunners, line: str) -> int:
    """Run a line as at the prompt."""
    code = exit_code_of(guide, lambda: lines.line(guide, split(line)) if split(line) else 0)
    return finish_line(guide, code)


def _say(output: Output, *lines: str) -> None:
    output.stdout.flush()
    output.lines([part for line in lines for part in line.split("\n")])
