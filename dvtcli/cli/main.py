"""The program: argv in, exit code out; what runs lines and scripts is imported on use."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.boundary import COMPLETING, LEAVE, exit_code_of, finish_line
from dvtcli.cli.catalogue import command_names
from dvtcli.cli.conversation import Conversation
from dvtcli.cli.registry import REGISTRY, WORDS
from dvtcli.cli.view.output import Output
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import TypedTcl
    from dvtcli.device.cancellation import Cancellation
    from dvtcli.device.target_config import TargetConfig


def main(argv: list[str] | None = None) -> int:
    """Run dvtcli with *argv* (default: the process's own) and return its exit code."""
    install()
    # before the bus is opened there is nothing to end in order, and a Ctrl-C ends the program at once
    session = Conversation(Output(), on_open=lambda: _catch_signals(session.cancellation))
    words = sys.argv[1:] if argv is None else argv
    if "--json" in words:  # also for errors that are found before the option is read
        session.start({"format": "json"})

    def run() -> Any:
        given: dict[str, Any] = {"obj": session}
        if COMPLETING in os.environ:  # a shell asks: click answers, and ends the program
            from dvtcli.cli.name_completion import make_shells_safe

            make_shells_safe()
            return REGISTRY.main(words, prog_name="dvtcli", standalone_mode=False, **given)
        # not by click's own `main`: that writes to a stderr that may be gone when it hears a Ctrl-C, and takes any
        # broken pipe, a driver's too, for the program's end
        with REGISTRY.make_context("dvtcli", list(words), **given) as ctx:
            try:
                return REGISTRY.invoke(ctx)
            except (click.ClickException, UsageError) as wrong:
                from dvtcli.cli.corrected_line import with_correction

                raise with_correction(wrong, ctx.meta.get(WORDS, ()), session) from wrong

    code = exit_code_of(session, run)
    code = 0 if code == LEAVE else code
    ended = finish_line(session, code, alone=not session.started)
    closing = exit_code_of(session, lambda: _closed(session))
    session.cancellation.hold()  # what comes now comes too late to be answered
    if code == 0 and session.cancellation.requested:
        session.output.note("the signal was too late: the command is complete and its changes remain")
    return ended or closing


def _catch_signals(cancellation: Cancellation) -> None:
    from dvtcli.cli.signals import catch_signals

    catch_signals(cancellation)


def _closed(session: Conversation) -> None:
    with session.cancellation.deferred():
        session.close()


class ImportedRunners:
    """`LineRunners` of `runner_interface`: prompt, scripts and lines."""

    def without_command(self, session: Conversation) -> int:
        """See `LineRunners.without_command`; a program's pipe is run line by line.

        Raises UsageError if stdin is empty, or `--sim` has a command's name as its family.
        """
        for word in session.options.sim:
            if word in command_names() and not Path(word).exists():
                raise UsageError(f"--sim {word}: {word} is a command, not a family", hint=f"`dvtcli --sim gen4 {word}`")
        if sys.stdin.isatty():
            from dvtcli.cli.prompt.loop import run_prompt

            return run_prompt(session)
        from dvtcli.cli.live_lines import answer_lines, is_a_program

        if is_a_program(session.output):
            return answer_lines(session)
        from dvtcli.cli.scripts.script import run_script
        from dvtcli.cli.scripts.script_parse import MOST_BYTES

        text = sys.stdin.buffer.read(MOST_BYTES + 1)
        if not text.strip():
            raise UsageError("no command: standard input is empty", hint="`dvtcli --help`")
        return run_script(session, text, "<stdin>", keep_going=False)

    def file(
        self,
        session: Conversation,
        file: str,
        *,
        keep_going: bool = False,
        atomic: bool = False,
        most_seconds: float | None = None,
    ) -> int:
        """See `LineRunners.file`; a FILE.tcl is run by Tcl."""
        from dvtcli.cli.scripts.script import run_script
        from dvtcli.cli.scripts.script_parse import MOST_BYTES
        from dvtcli.files.input_file import read_input_head

        if not file.lower().endswith(".tcl"):
            from dvtcli.operations.user.refused_options import refuse_options

            refuse_options({"max_seconds": most_seconds}, "for a Tcl script only, which can compute without end")
        if file == "-":
            data = sys.stdin.buffer.read(MOST_BYTES + 1)
            return run_script(session, data, "<stdin>", keep_going=keep_going, atomic=atomic)
        try:
            data = read_input_head(file, MOST_BYTES + 1)
        except OSError as failed:
            hint = "run takes the path of a script"
            raise UsageError(f"{file}: {failed.strerror}", place=file, hint=hint) from failed
        if not file.lower().endswith(".tcl"):
            return run_script(session, data, file, keep_going=keep_going, atomic=atomic)
        from dvtcli.cli.dvt.tcl_run import run_tcl

        if atomic:
            raise UsageError("--atomic is for .dvt scripts: the changes of a Tcl script are not known before it runs")
        return run_tcl(session, data, file, keep_going=keep_going, most_seconds=most_seconds)

    def tcl(self, session: Conversation) -> TypedTcl:
        """See `LineRunners.tcl`."""
        from dvtcli.cli.dvt.tcl_run import tcl_of

        return tcl_of(session)

    def line(self, session: Conversation, words: Sequence[str]) -> int:
        """See `LineRunners.line`."""
        from dvtcli.cli.run_line import run_words

        return run_words(words, session)

    def rehearsed(self, session: Conversation, file: str, node_id: int | None = None) -> dict[int, TargetConfig]:
        """See `LineRunners.rehearsed`."""
        from dvtcli.cli.scripts.rehearsal import rehearsed

        return rehearsed(session, file, node_id)

    def parsed(self, session: Conversation, path: Path) -> None:
        """See `LineRunners.parsed`."""
        from dvtcli.cli.scripts.script_parse import Reach, all_parsed, read_lines

        all_parsed(read_lines(path.read_bytes(), path.name), session, [path.name], {}, Reach())


def install() -> None:
    """Hand the runners to the registry for its commands."""
    REGISTRY.runners = ImportedRunners()
