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

from dvtcli.domain.rules.finding import Finding
from dvtcli.errors import DvtcliError, RuleError

T = TypeVar("T")

#: options of commands -> what they are called here, where that is another word
_ARGUMENTS = {
    "timer": "timer_ms",
    "inhibit": "inhibit_ms",
    "timeout": "timeout_s",
    "fault": "faults",
    "signal": "signals",
    "sim": "nodes",
    "all": "everything",
    "as": "as_type",
}
_SENTENCES = {
    "give -i/--interface and -c/--channel,": "give interface and channel,",
    "or --sim generic": "or dvtcli.simulate('generic')",
    "scan finds the nodes; `node ID` selects one at the prompt and in scripts, -n ID on the command line":
        "`scan` finds the nodes",
    "this session's changes": "this program's changes",
    "this session": "this program",
}  # fmt: skip
#: commands whose call has another name, or another owner than a node
_CALLS = {
    "pdo": "node.pdos",
    "node": "node.identity",
    "apply": "bus.apply",
    "check": "bus.check",
    "diff": "bus.plan",
    "eds add": "dvtcli.add_eds",
    "eds check": "dvtcli.check_eds",
    "eds convert": "dvtcli.convert",
    "eds list": "dvtcli.eds_library",
    "faults --clear": "node.clear_faults",
    "import": "bus.import_network",
    "link": "bus.link",
    "load": "bus.load",
    "lss scan": "bus.lss.scan",
    "plan": "bus.plan",
    "profiles": "dvtcli.profiles",
    "save": "bus.script",
    "scan": "bus.scan",
    "sync --check": "bus.check_sync",
    "unlink": "bus.unlink",
}
_OF_A_NODE = (
    "backup|clear|clone|compare|disable|download|enable|export|faults|learn|login|map|nmt|objects|read|recover|restore"
    "|set|store|undo|verify|vpdo|write"
)
_ONLY_COMMANDS = "bitrate|decode|doctor|eds|explain|gateway|log|monitor|plot|run|sim|trace|tour|watch"
_FLAGS = "yes|force|extended|frame|prove|all"
_MARKED = re.compile(r"`([^`]+)`")
_OPTION = re.compile(r"(?<![\w-])--([a-z]+(?:-[a-z]+)*)(?: (auto|keep)\b| (?=[A-Z]))?")
#: a command with options that stands in a sentence without marks
_BARE = re.compile(rf"\b({_OF_A_NODE}) --(mappable|{_FLAGS})\b(?: (tpdo|rpdo))?|^link \S+:\S+ \S+:\S+$")
#: what a text begins with that is about an option's value
_OF_OPTION = re.compile(r"^--([a-z]+)(?= [^:]+: )")


def in_python(text: str) -> str:
    """A *text* as a program wants it: `--yes` is `yes=True`, `--eds FILE` is `eds=FILE`, `pdo` is `node.pdos()`."""
    for said, meant in _SENTENCES.items():
        text = text.replace(said, meant)
    text = _BARE.sub(lambda found: f"`{found[0]}`", text) if "`" not in text else text
    text = _OF_OPTION.sub(lambda found: f"{_ARGUMENTS.get(found[1], found[1])}:", text)
    parts = re.split(r"(`[^`]+`)", text)
    return "".join(f"`{_call(part[1:-1])}`" if part[:1] == "`" else _OPTION.sub(_argument, part) for part in parts)


def _argument(option: re.Match[str]) -> str:
    """An option outside of a command."""
    name = _ARGUMENTS.get(option[1], option[1].replace("-", "_"))
    if option[2]:
        return f"{name}='{option[2]}'"
    if re.fullmatch(_FLAGS, option[1]):
        return f"{name}=True"
    return f"{name}=" if option[0].endswith(" ") else name


def _call(command: str) -> str:
    """The call for a *command*; for one that is a command only, how it is typed."""
    words = command.split()
    used = next((count for count in (2, 1) if " ".join(words[:count]) in _CALLS), 1)
    call = _CALLS.get(" ".join(words[:used]))
    if call is None and re.fullmatch(_OF_A_NODE, words[0]):
        call = f"node.{words[0]}"
    if call is None:
        return f"dvtcli {command}" if re.fullmatch(_ONLY_COMMANDS, words[0]) else command
    arguments = _arguments(words[used:])
    if arguments is None:
        return f"dvtcli {command}"
    if words[0] in ("pdo", "node") and arguments:
        call = {"pdo": "node.pdo", "node": "bus.node"}[words[0]]
        arguments = [one for one in arguments if one != "everything=True"]
        call = call if arguments else "node.pdos"
    if words[0] == "nmt":
        arguments = arguments[:1]
    return f"{call}({', '.join(arguments)})"


def _arguments(words: list[str]) -> list[str] | None:
    """What stands behind a command, as arguments; None where a call has no such option."""
    found: list[str] = []
    rest = iter(words)
    for word in rest:
        option = word.removeprefix("--")
        if option == word:
            found.append(word if word.isupper() or (word.isdecimal() and len(word) < 4) else repr(word))
        elif re.fullmatch(_FLAGS, option):
            found.append(f"{_ARGUMENTS.get(option, option)}=True")
        elif option == "mappable":
            found.append(f"mappable={next(rest, '')!r}")
        else:
            return None
    return found


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
    is_findings = isinstance(value, tuple) and bool(value) and isinstance(value[0], Finding)
    return tuple(map(_finding, value)) if is_findings else value


def _finding(one: Finding) -> Finding:
    return replace(one, text=in_python(one.text), hint=None if one.hint is None else in_python(one.hint))


def _in_this_programs_words(raised: DvtcliError, *, others: bool) -> None:
    def mine(text: str) -> str:
        return _of_this_program(in_python(text)) if others else in_python(text)

    raised.text = mine(raised.text)
    raised.args = (raised.text,)
    raised.why = None if raised.why is None else mine(raised.why)
    raised.hint = None if raised.hint is None else mine(raised.hint)
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
        yield from ((label, said) for label, said in (("why", raised.why), ("hint", raised.hint)) if said)
    if raised.exit_code not in (2, 4) or raised.state != "unchanged":
        yield "state", raised.state + (f": {in_python(raised.state_text)}" if raised.state_text else "")
