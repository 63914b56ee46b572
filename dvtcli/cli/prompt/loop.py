"""The prompt: reads lines at a terminal, runs each like a script line, and asks before leaving unstored changes."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, redirect_stderr, redirect_stdout
from typing import TYPE_CHECKING, Protocol, TextIO, cast

from dvtcli.cli.boundary import LEAVE, exit_code_of, finish_line
from dvtcli.cli.catalogue import command_names
from dvtcli.cli.lexer import split
from dvtcli.cli.prompt.line import CONTINUED, expanded, paged, usable_aliases, withheld_aliases
from dvtcli.cli.run_line import run_words
from dvtcli.cli.view.lines import Cell, Line
from dvtcli.cli.view.output import Output
from dvtcli.cli.view.streams import LONGEST_TYPED, as_lines, thrown_away, typed_ahead
from dvtcli.domain.text import plural, safe
from dvtcli.errors import DvtcliError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.cli.prompt.bus_watch import Notices
    from dvtcli.cli.prompt.status import Status
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.operations.session.session import SessionNodes

#: Exit code of a line that Ctrl-C ended; another signal (SIGTERM, SIGHUP) ends the prompt too, with its own code.
INTERRUPTED = 130
#: Exit code of a line that got no answer from its node or its bus.
SILENT = 5


def run_prompt(session: Conversation) -> int:
    """Open the bus and run lines until the user leaves; returns the program's exit code.

    Raises BusUnavailable if no bus opens.
    """
    from dvtcli.cli.prompt.bus_watch import Life, Notices
    from dvtcli.cli.prompt.first_start import first_start
    from dvtcli.cli.prompt.status import Status

    session.require_settings()
    session.comes_back = not session.options.no_reconnect
    first_start(session)
    session.started = session.at_prompt = True
    session.aliases = usable_aliases(session.settings)
    if (withheld := withheld_aliases(session.settings)) is not None:
        session.output.warning(withheld)
    session.output.pager = lambda text: not session.in_script and paged(text)
    _banner(session)
    for node in session.met_nodes():
        node.read_cache.clear()  # a line comes when it comes
    life = Life(session, Notices())
    session.frames = life.frames
    status = Status(session, life)
    life.start()
    try:
        lines = reader(session, status, life.notices, lambda line: _help(session, line))
        return Prompt(session, status, lines, life.line).run()
    finally:
        life.stop()
        if session.tcl is not None:
            session.tcl.close()


class Prompt:
    """The loop over typed lines."""

    def __init__(
        self, session: Conversation, status: Status, lines: Reader, busy: AbstractContextManager[object]
    ) -> None:
        self._session, self._status, self._reader = session, status, lines
        #: held during any work with nodes
        self._busy = busy
        #: whether a line ran since the last prompt, so that input was typed unseen
        self._has_run = False
        #: whether to read the node's state before a prompt; not after a timeout
        self._answers = True

    def run(self) -> int:
        """Read and run lines until the user leaves; returns 0, or the code of a signal."""
        while True:
            self._session.cancellation.reset()
            try:
                with self._busy:
                    self._status.refresh(ask=self._answers)
                self._session.output.progress_line.end()  # where a slow node was asked: the prompt begins its line
                code = self._turn()
            except EOFError:
                code = self._left_tcl()
            except KeyboardInterrupt:
                self._forget_open_tcl()
                code = 0  # Ctrl-C throws the line away; other signals are told apart below
            if self._terminated():
                return self._session.cancellation.exit_code
            if code == LEAVE and self._may_leave():
                return 0

    def _turn(self) -> int:
        """Read and run the input; pasted lines stop at the first failure, and those left are named."""
        lines = self._reader.read(self._typed_blindly()).replace("\\\n", " ").splitlines()
        code = 0
        for number, line in enumerate(lines, 1):
            self._session.cancellation.reset()
            with self._busy:
                code = self._run(line)
            if code or self._session.cancellation.requested:
                left = [text for text in lines[number:] if text.strip()]
                if left and code != LEAVE:
                    first = left[0].strip().split(" ")[0]  # the rest of it may have a passcode
                    ended = f"ended with exit code {code}" if code else "was stopped"
                    what = f"line {number} of {len(lines)} {ended}; {plural(len(left), 'line')} not run"
                    self._session.output.warning(f"{what}, from `{safe(first)}` on")
                break
        return code

    def _typed_blindly(self) -> str:
        """Return what was typed while another line ran, for the line to come: it must not run unseen.

        A terminal that cannot show it on the line discards it, with a note.
        """
        output = self._session.output
        kept, output.typed_ahead = output.typed_ahead or [], [] if self._reader.edits else None
        if not self._has_run:
            return ""
        self._has_run = False
        keys = "".join([*kept, self._reader.left_over(), typed_ahead(sys.stdin)])
        lines = as_lines(keys) if self._reader.edits else ""
        if not lines and (not self._reader.edits or len(keys) > LONGEST_TYPED):
            if said := thrown_away(keys):
                output.warning(said)
            return ""
        if lines:
            output.note("the line has the input typed in between; Enter runs it")
        return lines

    def _run(self, line: str) -> int:
        """Run a line; restores every node's NMT state, except if the line left changes."""
        from dvtcli.cli.prompt.line import checked, sent, taken_apart, tcl_line

        session = self._session
        self._has_run = True
        session.place = None  # a line of Tcl before this one had one

        def run() -> int:
            if session.tcl is not None and session.tcl.on:
                return session.tcl.typed(line)
            if (tcl := tcl_line(line, session.aliases)) is not None:
                return run_words(["tcl", tcl], session)
            command, destination = taken_apart(line, session.aliases)
            words = split(command)
            if destination is not None:
                destination = checked(destination, programs=not session.options.no_shell)
            if not words:
                return 0
            with sent(session.output, destination):
                return run_words(words, session)

        code = exit_code_of(session, run)
        code = finish_line(session, code)
        self._answers = code != SILENT
        return code

    def _left_tcl(self) -> int:
        """Handle Ctrl-D: leave Tcl mode if active, else the prompt."""
        tcl = self._session.tcl
        if tcl is None or not tcl.on:
            return LEAVE
        tcl.leave()
        return 0

    def _forget_open_tcl(self) -> None:
        if self._session.tcl is not None:
            self._session.tcl.forget()

    def _terminated(self) -> bool:
        return self._session.cancellation.exit_code != INTERRUPTED

    def _may_leave(self) -> bool:
        """Whether nothing is unstored, or the user confirms leaving."""
        unstored = self._status.unstored()
        if not unstored or self._session.options.yes or self._session.dry_run:
            return True
        what = " and ".join(f"{', '.join(labels)} of node {node_id}" for node_id, labels in unstored.items())
        several = len(unstored) > 1 or any(len(labels) > 1 for labels in unstored.values())
        try:
            leaves = self._session.output.ask(f"{what} {'are' if several else 'is'} not stored: leave?") or _gone()
        except KeyboardInterrupt:
            leaves = self._terminated()
        if not leaves:
            self._session.output.note("dvtcli stays open; store stores the changes, undo reverts them")
        return leaves


def _gone() -> bool:
    """Whether the terminal is gone, without anybody to ask."""
    return not sys.stdin.isatty()


def _help(session: Conversation, line: str) -> None:
    """Print help for the command of *line*, by name or alias, else the list of commands."""
    name = expanded(line, session.aliases).split()[:1]
    if "help" in command_names():
        run_words(["help", *(name if name and name[0] in command_names() else [])], session)


def _banner(session: Conversation) -> None:
    """Print the open bus and the help keys."""
    from dvtcli.version import __version__

    network = session.network
    session.output.stdout.flush()
    lines: list[Line] = []
    if network.simulated_ids:
        nodes = [_simulated(session.node(node_id)) for node_id in network.simulated_ids]
        lines.append(f"dvtcli {__version__}  simulated {nodes[0]}")
        lines += [f"{'':{len(__version__) + 9}}simulated {node}" for node in nodes[1:]]
        by = session.chosen_by()
        lines.append(f"No CAN hardware is used{'' if by == '--sim' else f' (chosen by {by})'}.")
    else:
        lines.append(f"dvtcli {__version__}  {session.wire.name}{_reached(session)}")
        lines.append(f"The bus was chosen by {session.chosen_by()}.")
    keys = [("Tab", "complete"), ("Ctrl-R", "history"), ("Ctrl-D", "leave")]
    if "help" in command_names():
        keys.insert(0, ("?", "help"))
    if "tour" in command_names():
        keys.append(("tour", "a start"))
    lines.append([cell for key, what in keys for cell in (Cell(key, "bold"), Cell(f"  {what}    "))])
    if not session.output.quiet and not session.output.json:
        session.output.lines([*lines, ""])


def _simulated(node: ReadableNode) -> str:
    pdos = node.present()
    sent = sum(pdo.is_tpdo for pdo in pdos)
    file = node.dictionary.source if node.dictionary is not None else "no EDS"
    return f'node {node.node_id} "{node.title}" ({file}, {sent} TPDO, {len(pdos) - sent} RPDO)'


def _reached(session: SessionNodes) -> str:
    """Return the selected node's answer or silence; the prompt starts in either case."""
    node_id = session.selected_id()
    if node_id is None:
        return "  no node is selected: scan finds nodes, `node ID` selects a node"
    try:
        node = session.node(node_id)
    except DvtcliError as silent:
        return f"  node {node_id} does not answer: {silent.text}"
    file = f" ({node.dictionary.source})" if node.dictionary is not None else " (no EDS: objects have no names)"
    return f'  node {node_id} "{node.title}"{file}'


class Reader(Protocol):
    """A source of lines."""

    #: whether a line can begin with text that was typed before
    edits: bool

    def read(self, begun: str = "") -> str:
        """Return the next line, which begins with *begun*.

        Raises KeyboardInterrupt if it was discarded, EOFError if the user leaves.
        """
        ...

    def left_over(self) -> str:
        """Take the keys received after the last line."""
        ...


def reader(session: Conversation, status: Status, notices: Notices, show_help: Callable[[str], None]) -> Reader:
    """The best reader for this terminal; *show_help* prints help for the line typed so far."""
    if not sys.stdout.isatty() or os.environ.get("TERM", "").lower() in ("dumb", "unknown"):
        return PlainReader(status, notices, session.output)
    return FullReader(session, status, notices, show_help)


class PlainReader:
    """Lines as the terminal itself edits them: for terminals that cannot draw, and for stdout in a pipe."""

    edits = False

    def __init__(self, status: Status, notices: Notices, output: Output) -> None:
        self._status, self._notices, self._output = status, notices, output

    def read(self, begun: str = "") -> str:
        """Prompt on stderr, so that stdout has results only; *begun* is empty."""
        del begun
        with self._notices.shown_by(lambda text: self._output.lines([text])):
            try:
                self._notices.pump()
                line = self._asked(self._status.prompt())
                while line.endswith("\\\n"):
                    line += self._asked(CONTINUED)
            except KeyboardInterrupt:
                self._output.lines([""])
                raise
        if not line:
            self._output.lines([""])
            raise EOFError
        return line

    def left_over(self) -> str:
        """Return nothing: a line-buffered terminal delivers single lines."""
        return ""

    def _asked(self, prompt: str) -> str:
        self._output.stderr.write(prompt)
        self._output.stderr.flush()
        return sys.stdin.readline()


class FullReader:
    """Lines with a menu, history and a toolbar; messages of nodes appear above the prompt."""

    edits = True

    def __init__(
        self, session: Conversation, status: Status, notices: Notices, show_help: Callable[[str], None]
    ) -> None:
        from dvtcli.cli.prompt.full_line import prompt_session

        self._session, self._status, self._notices = session, status, notices
        self._prompt = prompt_session(session, status, show_help)
        self._most_menu = self._prompt.reserve_space_for_menu

    def read(self, begun: str = "") -> str:
        """Ask with everything that prompt_toolkit has and the terminal has rows for; the line begins with *begun*."""
        from prompt_toolkit.patch_stdout import StdoutProxy

        from dvtcli.cli.prompt.full_line import ROWS_OF_TEXT

        # The proxy that patch_stdout(raw=True) makes; a shorter pause, since a command waits for it to close.
        with StdoutProxy(raw=True, sleep_between_writes=0.02) as proxy:
            above = cast(TextIO, proxy)
            output = Output(above, above)
            output.configure("text", self._session.base.color, 0, quiet=False, plain=self._session.base.ascii)
            with (
                redirect_stdout(above),
                redirect_stderr(above),
                self._notices.shown_by(lambda text: output.lines([text])),
            ):
                self._notices.pump()
                rows = self._prompt.output.get_size().rows
                self._prompt.reserve_space_for_menu = max(0, min(self._most_menu, rows - ROWS_OF_TEXT))
                with _held_interrupts() as held:
                    line = self._typed(begun)
        if held or line is None:
            raise KeyboardInterrupt
        return line

    def left_over(self) -> str:
        """Take input read together with the last line, except the terminal's own replies."""
        from prompt_toolkit.input.typeahead import get_typeahead
        from prompt_toolkit.keys import Keys

        keys = get_typeahead(self._prompt.app.input)
        return "".join(key.data for key in keys if key.key is not Keys.CPRResponse)

    def _typed(self, begun: str) -> str | None:
        """Return the typed line, which began with *begun*; None if discarded."""
        from dvtcli.cli.prompt.full_line import ThrownAway

        try:
            return self._prompt.prompt(default=begun)
        except ThrownAway:
            return None


@contextmanager
def _held_interrupts() -> Iterator[list[int]]:
    """Collect SIGINT in the list while prompt_toolkit starts and ends, because it would break the event loop.

    While a line is typed, prompt_toolkit handles Ctrl-C itself and discards the line.
    """
    held: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _frame: held.append(number))
    try:
        yield held
    finally:
        signal.signal(signal.SIGINT, before)
