"""Operations that run beside a full screen: one at a time in a thread, their messages and questions on the screen."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING

from dvtcli.cli.screen.widgets import Question
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.errors import DvtcliError

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.ports import Frame
    from dvtcli.operations.results.bus_events import BusEvent

#: interval at which a wait for an operation's end sees a Ctrl-C (s)
_LOOK_S = 0.1


class BesideScreen:
    """Runs operations of *session* in a thread, and is its reporter until `leave`.

    *turn* is held while an operation runs: others that use the nodes take it too.
    """

    def __init__(self, session: Conversation) -> None:
        self.turn = threading.Lock()
        #: the open question, None if there is none
        self.question: Question | None = None
        #: what is being done, empty for nothing
        self.doing = ""
        self._session, self._outer = session, session.reporter
        self._said: deque[tuple[str, bool]] = deque()
        self._failure: BaseException | None = None
        self._thread: threading.Thread | None = None
        self._answer: bool | None = None
        self._answered = threading.Event()
        self._leaving = self._is_check = False
        session.reporter = self

    def start(self, doing: str, work: Callable[[], str], *, is_check: bool = False) -> None:
        """Do *work* now, called *doing*; its text is said at its end. Says so if another operation is running.

        *is_check*: it asks nothing, and another operation begins after it.
        """
        if self.doing and not self._is_check:
            self.say(f"{doing}: not yet, {self.doing} is going on", bad=True)
            return
        self.doing, self._is_check = doing, is_check
        self._thread = threading.Thread(target=self._run, args=(work,), name=doing, daemon=True)
        self._thread.start()

    def _run(self, work: Callable[[], str]) -> None:
        try:
            with self.turn:
                if text := work():
                    self.say(text)
        except DvtcliError as failed:
            self.say(in_a_line(self._session, failed), bad=True)
        except BaseException as failed:  # noqa: BLE001 - nobody sees what ends a thread: `news` raises it
            self._failure = failed
        finally:
            if self._mine():
                self.doing, self._is_check = "", False

    def say(self, text: str, *, bad: bool = False) -> None:
        """Show *text* among the screen's messages, or after the screen once it is left."""
        if self._leaving and not self._mine():
            (self._outer.warning if bad else self._outer.note)(text)
        else:
            self._said.append((text, bad))

    def news(self) -> list[tuple[str, bool]]:
        """Return the messages since the last call, each with whether it is bad. Raises an operation's bug."""
        if self._failure is not None:
            raise self._failure
        return [self._said.popleft() for _ in range(len(self._said))]

    def leave(self) -> None:
        """Answer an open question with no, wait for the operation, and give the session its reporter back."""
        self._leaving = True
        self._answered.set()
        while self._thread is not None and self._thread.is_alive():
            self._thread.join(_LOOK_S)
        self._session.reporter = self._outer
        for text, bad in self._said:
            (self._outer.warning if bad else self._outer.note)(text)

    def _mine(self) -> bool:
        return threading.current_thread() is self._thread

    def note(self, text: Hint | str) -> None:
        """Show a message of an operation; others are told after the screen."""
        if self._mine():
            self.say(self._session.output.hints().text(text))
        else:
            self._outer.note(text)

    def warning(self, text: Hint | str) -> None:
        """Show a warning of an operation; others are told after the screen."""
        if self._mine():
            self.say(self._session.output.hints().text(text), bad=True)
        else:
            self._outer.warning(text)

    def bus(self, event: BusEvent) -> None:
        """Report a lost or restored bus after the screen."""
        self._outer.bus(event)

    def instruct(self, text: str) -> None:
        """Show what the user must do."""
        self.say(text, bad=True)

    def ask(self, question: str) -> bool | None:
        """Ask on the screen; no if the screen is left."""
        if not self._mine():
            return self._outer.ask(question)
        self._answer = None
        self._answered.clear()
        if self._leaving:
            return False
        self.question = Question(question, self._take_answer)
        try:
            self._answered.wait()
        finally:
            self.question = None
        return bool(self._answer)

    def confirm(self, question: str, word: str) -> bool | None:
        """Nobody types a word on a screen of keys; others are asked as usual."""
        return None if self._mine() else self._outer.confirm(question, word)

    def _take_answer(self, answer: bool) -> None:
        self._answer = answer
        self._answered.set()

    def progress(self, text: str, done: int, total: int) -> None:
        """Show no progress: the screen itself moves."""

    def traffic(self, frame: Frame, *, sent: bool, secret: slice | None) -> None:
        """Report a frame after the screen, if wanted."""
        self._outer.traffic(frame, sent=sent, secret=secret)


def in_a_line(session: Conversation, failed: DvtcliError) -> str:
    """Return *failed* with its reason and hint on one line."""
    words = [error_text(failed), failed.why or "", session.output.hints().text(failed.hint) if failed.hint else ""]
    return "; ".join(word for word in words if word)
