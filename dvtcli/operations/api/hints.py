"""What errors and answers say to a command's user, as a program wants it: in its own words, and whole in a traceback.

Does not know which error it is.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from dvtcli.domain.hint import Hint
from dvtcli.domain.rules.finding import Finding
from dvtcli.errors import DvtcliError, RuleError
from dvtcli.files.input_file import forget_pipes
from dvtcli.operations.api.called_hints import called
from dvtcli.operations.api.python_hints import hint_in_python, in_python

T = TypeVar("T")


def _of_this_program(text: str) -> str:
    """*text* in which this process is not called another one: a Bus of it holds the node, and ends with its call."""
    text = re.sub(rf"another dvtcli \(process {os.getpid()}\b[^)]*\)", "another Bus of this program", text)
    return re.sub(
        rf"when it has finished; where it hangs, end process {os.getpid()},.*", "when its call has ended", text
    )


@contextmanager
def python_words(*, others: bool = False) -> Iterator[None]:
    """A block whose errors speak of arguments and calls, and say in a traceback all that a command would.

    *others*: this program has other buses open.
    """
    try:
        yield
    except DvtcliError as raised:
        _in_this_programs_words(raised, others=others)
        for label, said in _further(raised):
            raised.add_note(f"{label}: {said}")
        raise
    finally:
        forget_pipes()  # the next call may be for another pipe of this name


def answer_in_python(answer: T) -> T:
    """An *answer* whose findings, and what it says of keeping what was set, are words of a program."""
    if not is_dataclass(answer) or isinstance(answer, type):
        return answer
    said = {field.name: getattr(answer, field.name) for field in fields(answer) if field.init}
    changed = {name: _worded(name, value) for name, value in said.items()}
    return replace(answer, **changed) if changed != said else answer


def _worded(name: str, value: Any) -> Any:
    if name == "keep":
        return {node: in_python(one) for node, one in value.items()} if isinstance(value, dict) else in_python(value)
    if isinstance(value, tuple) and value and isinstance(value[0], Finding):
        return tuple(map(_finding, value))
    if isinstance(value, tuple) and any(isinstance(getattr(row, "hint", None), Hint) for row in value):
        return tuple(replace(row, hint=_hint(row.hint)) for row in value)
    if isinstance(value, tuple) and any(isinstance(line, Hint) for line in value):
        return tuple(called(line) if isinstance(line, Hint) else line for line in value)
    return called(value) if isinstance(value, Hint) else value


def _finding(one: Finding) -> Finding:
    return replace(one, text=in_python(one.text), hint=_hint(one.hint))


def _hint(hint: Hint | str | None) -> str | None:
    return called(hint) if isinstance(hint, Hint) else hint and hint_in_python(hint)


def _in_this_programs_words(raised: DvtcliError, *, others: bool) -> None:
    def mine(text: str) -> str:
        return _of_this_program(text) if others else text

    raised.text = mine(in_python(raised.text))
    raised.args = (raised.text,)
    raised.why = None if raised.why is None else mine(in_python(raised.why))
    hint = _hint(raised.hint)
    raised.hint = hint and mine(hint)
    raised.details = [(label, in_python(said)) for label, said in raised.details]
    if isinstance(raised, RuleError):
        raised.findings = tuple(map(_finding, raised.findings))


def _further(raised: DvtcliError) -> Iterator[tuple[str, str]]:
    """What an error says behind its first line, each with its label."""
    yield from raised.details
    if isinstance(raised, RuleError):
        for one in raised.findings:
            also = "" if one.text in raised.text else f"{one.text}; "
            yield "rule", f"{also}{one.rule} at {one.place}" + (f"; {one.hint}" if one.hint else "")
    else:
        yield from ((label, str(said)) for label, said in (("why", raised.why), ("hint", raised.hint)) if said)
    if raised.exit_code not in (2, 4) or raised.state != "unchanged":
        said = in_python(raised.state_text or "")
        for screen in ("LEFT CHANGED: see above; ", f"{raised.state}: "):  # it stands in front, and nothing above it
            said = said.removeprefix(screen)
        yield "state", f"{raised.state}: {said}" if said else raised.state
