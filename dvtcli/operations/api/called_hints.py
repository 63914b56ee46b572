"""Write hints, in errors and results, as calls of this API."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from dvtcli.domain.hint import Action, Hint, sentence
from dvtcli.domain.rules.finding import Finding
from dvtcli.errors import DvtcliError, InputFileError, RuleError
from dvtcli.files.input_file import forget_pipes

T = TypeVar("T")

#: Actions -> call; `node.` is another node's if the hint names it. An action without call is a command.
CALLS: dict[Action, str] = {
    Action.SHOW_PDOS: "node.pdos()",
    Action.SHOW_NODE: "node.identity()",
    Action.FIND_NODES: "bus.scan()",
    Action.FIND_OBJECTS: "node.objects({text|TEXT})",
    Action.SHOW_MAPPABLE: "node.objects(mappable={direction})",
    Action.SHOW_FAULTS: "node.faults()",
    Action.VERIFY: "node.verify({file})",
    Action.MONITOR: "dvtcli monitor",
    Action.MAP: "node.map({pdo}, {objects|OBJECT} {off?enabled=False})",
    Action.SET_PDO: "node.set({pdo} {cob_id=} {extended?extended=True} {rtr?rtr=True} {no_rtr?rtr=False} "
    "{inhibit?inhibit_ms=}{inhibit} {sync_start=})",
    Action.CLEAR: "node.clear({pdo})",
    Action.ENABLE: "node.enable({pdo})",
    Action.DISABLE: "node.disable({pdo})",
    Action.READ: "node.read({object|OBJECT})",
    Action.WRITE: "node.write({object|OBJECT}, {value|VALUE})",
    Action.EDIT_PDO: "dvtcli pdo edit PDO",
    Action.SHOW_VPDO: "node.vpdo({group})",
    Action.LINK: "bus.link({producer}, {consumer})",
    Action.UNDO: "node.undo({all?everything=True} {force?force=True})",
    Action.RECOVER: "node.recover({yes?yes=True})",
    Action.RECOVER_ALL: "bus.recover()",
    Action.FINISH_STORES: "bus.finish_stores()",
    Action.STORE: "node.store({what} {force?force=True})",
    Action.RESTORE: "node.restore({what})",
    Action.PROVE_STORE: "node.store({what} prove=True)",
    Action.PROVE_RESTORE: "node.restore({what} prove=True)",
    Action.PROVE_POWER: "node.store(prove='power'{within?, within_s=S})",
    Action.RESET_NODE: "node.nmt('reset-node')",
    Action.RESET_COMMUNICATION: "node.nmt('reset-comm')",
    Action.START_NODE: "node.nmt('start')",
    Action.SEND_SYNC: "bus.sync({count|COUNT}{period?, period_ms=}{period})",
    Action.ENTER_PRE_OPERATIONAL: "node.nmt('preop')",
    Action.CHECK_LIVE: "bus.check()",
    Action.SHOW_LOAD: "bus.load()",
    Action.CHECK_SYNC: "bus.check_sync()",
    Action.CHECK_SETUP: "dvtcli doctor",
    Action.TRUST: "dvtcli trust",
    Action.LISTEN_BIT_RATE: "dvtcli bitrate",
    Action.SERVE: "dvtcli sim NODE --listen HOST:PORT",
    Action.CORRECT: "dvtcli LINE",
    Action.RUN: "dvtcli run FILE",
    Action.CHECK: "bus.check({file|FILE} {bit_rate=})",
    Action.PLAN: "bus.plan({file|FILE})",
    Action.APPLY: "bus.apply({file|FILE})",
    Action.APPLY_NETWORK: "bus.apply({file|FILE})",
    Action.COMPARE: "node.compare({file|FILE})",
    Action.LSS_SCAN: "bus.lss.scan({wait_s=})",
    Action.LSS_SELECT: "bus.lss.select(ADDRESS)",
    Action.LSS_STORE: "bus.lss.store({of})",
    Action.LSS_ASSIGN: "bus.lss.assign({file|FILE})",
    Action.LSS_BIT_RATE: "bus.lss.bit_rate({rate|RATE})",
    Action.LSS_IDENTIFY: "bus.lss.identify()",
    Action.LSS_NODE_ID: "bus.lss.node_id({id|ID})",
    Action.LOG_IN: "node.login({level})",
    Action.LEARN: "node.learn({save=})",
    Action.CHECK_EDS: "dvtcli.check_eds({file|FILE})",
    Action.ADD_EDS: "dvtcli.add_eds({file|FILE}{identity?, vendor=VENDOR, product=PRODUCT})",
    Action.SHOW_EDS: "dvtcli eds show FILE",
    Action.LIST_EDS: "dvtcli.eds_library()",
    Action.REMOVE_EDS: "dvtcli eds remove FILE",
    Action.LOG: "node.record(FILE)",
    Action.LOG_VALUES: "dvtcli log FILE --decode",
    Action.READ_VALUES: "dvtcli read OBJECT --every TIME",
    Action.SAVE_PLAN: "dvtcli plan FILE -o PLAN",
    Action.CONVERT: "dvtcli.convert({file|FILE}, {target|TARGET}{of?, node=}{of}{plain?, plain=True})",
    Action.EXPORT: "node.export({file|FILE} {twice?twice=True})",
    Action.IMPORT: "bus.import_network({file|FILE})",
    Action.BACKUP: "node.backup({file|FILE})",
    Action.SAVE_SCRIPT: "bus.script({all?everything=True} {history?history=True})",
    Action.DECODE: "dvtcli decode FILE",
    Action.DRAW: "bus.report({file|'NAME.html'})",
}
#: Actions -> argument of the same call, or of the call that opened the bus.
ARGUMENTS: dict[Action, str] = {
    Action.SELECT_CAN_ID: "cob_id={can_id|'auto'}",
    Action.LEAVE_OFF: "enabled=False",
    Action.EXTEND: "extended=True",
    Action.FORBID_RTR: "rtr=False",
    Action.ALLOW_RTR: "rtr=True",
    Action.GIVE_EDS: "eds=FILE",
    Action.GIVE_PROFILE: "profile=NAME",
    Action.GIVE_USER: "user=",
    Action.GIVE_CHANNEL: "channel=",
    Action.GIVE_INTERFACE: "interface=",
    Action.GIVE_BIT_RATE: "bitrate=",
    Action.GIVE_BUS: "bus=",
    Action.GIVE_SIMULATED: "dvtcli.simulate({what|WHAT})",
    Action.GIVE_SETTING: "{setting|KEY=VALUE}",
    Action.GIVE_JOURNAL: "journal=DIR",
    Action.GIVE_TIMEOUT: "timeout_s",
    Action.GIVE_NAME: "save=",
    Action.GIVE_DBC: "dbc=FILE",
    Action.AGREE: "yes=True",
    Action.FORCE: "force=True",
    Action.SHOW_FRAMES: "`dvtcli -vv`",
}
#: arguments without a call -> the command
_COMMANDS = {
    "accept": "dvtcli recover --accept", "discard": "dvtcli recover --discard", "backup": "dvtcli undo --backup",
    "mpdo": "dvtcli set PDO --mpdo KIND", "recording": "dvtcli --json check RECORDING",
}  # fmt: skip
#: placeholders for words known only to the user
_PLACEHOLDERS = frozenset({"FILE", "ID", "NAME", "NODE", "NUMBER", "OBJECT", "S", "TIME", "TYPE", "VALUE", "WHEN"})
_HEXADECIMAL = re.compile(r"0x[0-9A-F]+")
_FIELD = re.compile(r"\{(\w+)(?:(\?|=|\|)([^{}]*))?\}")


def called(hint: Hint) -> str:
    """Write *hint* in a line, its calls between marks."""
    return sentence(hint, _called)


def _called(step: Hint) -> str:
    assert step.action is not None  # noqa: S101 - `sentence` asks for actions only
    arguments = _of_node(step.arguments)
    if step.action is Action.GIVE:
        return ", ".join(map(_argument, arguments.items()))
    if command := next((command for name, command in _COMMANDS.items() if arguments.get(name)), None):
        return f"`{command}`"
    if step.action in ARGUMENTS:
        return _filled(ARGUMENTS[step.action], arguments)
    if step.action is Action.SHOW_PDOS and arguments.get("pdo") is not None:
        call = f"node.pdo({str(arguments['pdo'])!r})"
    elif step.action is Action.SHOW_NODE and arguments.get("node") is not None:
        call = f"bus.node({arguments['node']})"
    else:
        call = _filled(CALLS[step.action], arguments)
    node = arguments.get("node")
    return f"`{call}`" if node is None else f"`{re.sub(r'^node[.]', f'bus.node({node}).', call)}`"


def _of_node(arguments: Mapping[str, Any]) -> Mapping[str, Any]:
    """Take the node-ID of `5:rpdo2` among *arguments* as the node: a call of a node takes its PDO alone."""
    node, _, pdo = str(arguments.get("pdo", "")).partition(":")
    return {**arguments, "node": int(node), "pdo": pdo} if pdo and node.isdecimal() else arguments


def _argument(given: tuple[str, Any]) -> str:
    """Write an argument in Python; only its name without a value."""
    name, value = given
    if name == "verbose":
        return "`dvtcli -v`"
    return name if value is None else f"{name}={_value(value)}"


def _value(given: Any) -> str:
    if type(given) is tuple:
        return ", ".join(map(_value, given))
    is_plain = isinstance(given, int | float) or str(given) in _PLACEHOLDERS or _HEXADECIMAL.fullmatch(str(given))
    return str(given) if is_plain else repr(str(given))


def _filled(template: str, arguments: Mapping[str, Any]) -> str:
    """Fill *template* with *arguments* in Python; missing arguments are dropped with their comma."""
    values: list[str] = []

    def place(found: re.Match[str]) -> str:
        name, mark, other = found[1], found[2], found[3]
        given = arguments.get(name)
        if mark == "?":
            return other if given else ""
        if given is None:
            return other if mark == "|" else ""
        values.append(_value(given))
        return f"{name}=\0" if mark == "=" else "\0"

    text = re.sub(r" {2,}", " ", _FIELD.sub(place, template))
    text = re.sub(r"\( | \)", lambda edge: edge[0].strip(), text)
    text = re.sub(r"(?<=[\w'\0]) (?=\w+=)", ", ", text)
    return re.sub("\0", lambda _place: values.pop(0), text)


def in_calls(text: Hint | str) -> str:
    """Write *text* with its next steps as calls."""
    return called(text) if isinstance(text, Hint) else text


def answer_in_calls(answer: T) -> T:
    """Return *answer* with hints as calls; the same object if it has no hints."""
    changed = _hints_in_calls(answer)
    return replace(answer, **changed) if changed else answer  # type: ignore[type-var]


def _hints_in_calls(answer: Any) -> dict[str, Any]:
    """Return the fields of *answer* with hints, as calls."""
    if not is_dataclass(answer) or isinstance(answer, type):
        return {}
    said = {field.name: getattr(answer, field.name) for field in fields(answer) if field.init}
    found = {name: _part(value) for name, value in said.items()}
    return {name: value for name, value in found.items() if value is not said[name]}


def _part(value: Any) -> Any:
    """Convert a field's *value*: a hint, rows with hints, or findings; everything else stays."""
    if isinstance(value, Hint):
        return called(value)
    if type(value) is tuple and any(isinstance(row, Hint | Finding) or _hints_in_row(row) for row in value):
        return tuple(map(_row, value))
    if type(value) is tuple and any(type(getattr(row, "findings", None)) is tuple for row in value):
        return tuple(answer_in_calls(row) for row in value)  # a report for each file
    if isinstance(value, dict) and any(isinstance(row, Hint) for row in value.values()):
        return {key: _row(row) for key, row in value.items()}
    return value


def _row(row: Any) -> Any:
    if isinstance(row, Hint):
        return called(row)
    if isinstance(row, Finding):
        return _finding(row)
    found = {name: called(hint) for name, hint in _hints_in_row(row).items()}
    return replace(row, **found) if found else row


def _hints_in_row(row: Any) -> dict[str, Hint]:
    said = {} if not is_dataclass(row) else {field.name: getattr(row, field.name) for field in fields(row)}
    return {name: value for name, value in said.items() if isinstance(value, Hint)}


def _finding(finding: Finding) -> Finding:
    return replace(finding, text=in_calls(finding.text), hint=finding.hint and in_calls(finding.hint))


@contextmanager
def errors_in_calls(*, others: bool = False) -> Iterator[None]:
    """Give errors of a block arguments and calls in their text, and a command's full report in tracebacks.

    *others*: this program has other buses open.
    """
    try:
        yield
    except DvtcliError as raised:
        _say_in_calls(raised, others=others)
        for label, said in _further(raised):
            raised.add_note(f"{label}: {said}")
        raise
    finally:
        forget_pipes()  # the next call may be for another pipe of this name


def _say_in_calls(raised: DvtcliError, *, others: bool) -> None:
    if raised.abort is not None:
        from dvtcli.operations.user.usual_cause import add_usual_cause

        add_usual_cause(raised)

    def said(text: Hint | str) -> str:
        return _of_this_program(in_calls(text)) if others else in_calls(text)

    wrong = " and ".join(
        name if value is None or value is True else f"{name}={value}" for name, value in raised.given.items()
    )
    raised.text, raised.given = said(f"{wrong}: {raised.text}" if wrong else raised.text), {}
    raised.args = (raised.text,)
    raised.why = None if raised.why is None else said(raised.why)
    raised.hint = raised.hint and said(raised.hint)
    raised.details = [(label, in_calls(text)) for label, text in raised.details]
    if isinstance(raised, RuleError):
        raised.findings = tuple(map(_finding, raised.findings))


def _of_this_program(text: str) -> str:
    """Name this program in *text* instead of another process: a Bus of this program has the node until a call ends."""
    text = re.sub(rf"another dvtcli \(process {os.getpid()}\b[^()]*\)", "another Bus of this program", text)
    return re.sub(rf"when it has finished; if it hangs, end process {os.getpid()},.*", "when its call has ended", text)


def _further(raised: DvtcliError) -> Iterator[tuple[str, str]]:
    """Yield the labelled details of an error."""
    yield from raised.details
    if isinstance(raised, InputFileError):
        yield from (("error", f"{complaint.place}: {complaint.text}") for complaint in raised.complaints)
    if isinstance(raised, RuleError):
        for finding in raised.findings:
            also = "" if finding.text in raised.text else f"{finding.text}; "
            yield "rule", f"{also}{finding.rule} at {finding.place}" + (f"; {finding.hint}" if finding.hint else "")
    else:
        yield from ((label, str(said)) for label, said in (("why", raised.why), ("hint", raised.hint)) if said)
    if raised.exit_code not in (2, 4) or raised.state != "unchanged":
        said = in_calls(raised.state_text or "")
        for screen in ("LEFT CHANGED: see above; ", f"{raised.state}: "):  # it stands in front, and nothing above it
            said = said.removeprefix(screen)
        yield "state", f"{raised.state}: {said}" if said else raised.state
