"""What errors say to a command's user, as a program wants it. Does not know which error it is."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager

from dvtcli.errors import DvtcliError

#: options of commands -> what they are called here
_ARGUMENTS = {
    "cob-id": "cob_id",
    "timer": "timer_ms",
    "inhibit": "inhibit_ms",
    "eds": "eds",
    "profile": "profile",
    "timeout": "timeout_s",
    "fault": "faults",
    "signal": "signals",
}
_SENTENCES = {
    "give -i/--interface and -c/--channel,": "give interface and channel,",
    "or --sim generic": "or dvtcli.simulate('generic')",
}
_ANSWERS = "yes|force|extended|frame"
_METHODS = "learn|undo|map|set|enable|disable|clear|write|store|restore|verify|recover"


def in_python(hint: str) -> str:
    """A *hint* as a program wants it: `--yes` is `yes=True`, `--eds FILE` is `eds=FILE`."""
    for said, meant in _SENTENCES.items():
        hint = hint.replace(said, meant)
    hint = re.sub(rf"\b({_METHODS}) --({_ANSWERS})\b", r"\1(\2=True)", hint)
    hint = re.sub(rf"(?<![\w-])--({_ANSWERS})\b", r"\1=True", hint)
    option = rf"(?<![\w-])--({'|'.join(_ARGUMENTS)})\b"
    hint = re.sub(rf"{option} (auto|keep)\b", lambda one: f"{_ARGUMENTS[one[1]]}='{one[2]}'", hint)
    hint = re.sub(rf"{option} (?=[A-Z])", lambda one: f"{_ARGUMENTS[one[1]]}=", hint)
    return re.sub(option, lambda one: _ARGUMENTS[one[1]], hint)


def _of_this_program(text: str) -> str:
    """*text* in which this process is not called another one: a Bus of it holds the node, and ends with its call."""
    text = re.sub(rf"another dvtcli \(process {os.getpid()}\b[^)]*\)", "another Bus of this program", text)
    return re.sub(
        rf"when it has finished; where it hangs, end process {os.getpid()},.*", "when its call has ended", text
    )


@contextmanager
def python_words(*, others: bool = False) -> Iterator[None]:
    """A block whose errors speak of arguments instead of options; *others*: this program has other buses open."""
    try:
        yield
    except DvtcliError as raised:
        raised.hint = None if raised.hint is None else in_python(raised.hint)
        if others:
            raised.text = _of_this_program(raised.text)
            raised.args = (raised.text,)
            raised.hint = None if raised.hint is None else _of_this_program(raised.hint)
        raise
