"""Hints as they are typed: each action as a command line with the bus and the node of this call, or as an option."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from dvtcli.domain.hint import Action, Hint, filled, sentence

if TYPE_CHECKING:
    from dvtcli.errors import DvtcliError
    from dvtcli.operations.results.checks import FileFinding

#: Actions that are commands; a command without a node gets `-n` (except `_OF_THE_BUS`).
COMMANDS: dict[Action, str] = {
    Action.SHOW_PDOS: "pdo {pdo} {all?--all}",
    Action.SHOW_NODE: "node {node}",
    Action.FIND_NODES: "scan",
    Action.FIND_OBJECTS: "objects {text|TEXT}",
    Action.SHOW_MAPPABLE: "objects --mappable {direction}",
    Action.SHOW_FAULTS: "faults",
    Action.VERIFY: "verify {file}",
    Action.MONITOR: "monitor",
    Action.MAP: "map {pdo} {objects|OBJECT…} {off?--off}",
    Action.CLEAR: "clear {pdo}",
    Action.ENABLE: "enable {pdo}",
    Action.DISABLE: "disable {pdo}",
    Action.SET_PDO: "set {pdo} {cob_id?--cob-id} {cob_id} {extended?--extended} {rtr?--rtr} {no_rtr?--no-rtr} "
    "{inhibit?--inhibit} {inhibit} {sync_start?--sync-start} {sync_start} {mpdo?--mpdo} {mpdo}",
    Action.READ: "read {object|OBJECT} {into?-o} {into}",
    Action.WRITE: "write {object|OBJECT} {value|VALUE}",
    Action.EDIT_PDO: "pdo edit {pdo}",
    Action.SHOW_VPDO: "vpdo {group}",
    Action.LINK: "link {producer} {consumer}",
    Action.CORRECT: "{words|LINE…}",
    Action.UNDO: "undo {all?--all} {backup?--backup} {when} {force?--force}",
    Action.RECOVER: "recover {accept?--accept} {discard?--discard} {yes?--yes}",
    Action.RECOVER_ALL: "recover",
    Action.FINISH_STORES: "recover --finish {yes?--yes}",
    Action.STORE: "store {what} {force?--force}",
    Action.RESTORE: "restore {what}",
    Action.PROVE_STORE: "store {what} --prove",
    Action.PROVE_RESTORE: "restore {what} --prove",
    Action.PROVE_POWER: "store --prove power {within?--within} {within}",
    Action.RESET_NODE: "nmt reset-node {node}",
    Action.RESET_COMMUNICATION: "nmt reset-comm {node}",
    Action.START_NODE: "nmt start {node}",
    Action.SEND_SYNC: "sync --period {period|MS} --count {count|COUNT}",
    Action.ENTER_PRE_OPERATIONAL: "nmt preop {node}",
    Action.CHECK_LIVE: "check --live",
    Action.SHOW_LOAD: "load",
    Action.CHECK_SYNC: "sync --check",
    Action.CHECK_SETUP: "doctor",
    Action.TRUST: "trust",
    Action.LISTEN_BIT_RATE: "bitrate",
    Action.SERVE: "sim NODE… --listen {address|HOST:PORT}",
    Action.RUN: "run {file|FILE}",
    Action.CHECK: "check {file|FILE} {bit_rate?--at} {bit_rate}",
    Action.PLAN: "plan {file|FILE}",
    Action.APPLY: "apply {file|FILE} {to_manager?--to-manager} {to_manager} {force?--force}",
    Action.APPLY_NETWORK: "apply {file|FILE}",
    Action.COMPARE: "compare {file|FILE} {all?--all}",
    Action.LSS_SCAN: "lss scan {wait?--wait} {wait}",
    Action.LSS_SELECT: "lss select ADDRESS",
    Action.LSS_STORE: "lss store {of}",
    Action.LSS_ASSIGN: "lss assign {file|FILE}",
    Action.LSS_BIT_RATE: "lss bitrate {rate|RATE}",
    Action.LSS_IDENTIFY: "lss identify",
    Action.LSS_NODE_ID: "lss node-id {id|ID} {address}",
    Action.LOG_IN: "login {level}",
    Action.LEARN: "learn {save?--save} {save}",
    Action.CHECK_EDS: "eds check {file|FILE}",
    Action.ADD_EDS: "eds add {file|FILE} {identity?--identity} {identity}",
    Action.SHOW_EDS: "eds show {file|FILE}",
    Action.LIST_EDS: "eds list",
    Action.REMOVE_EDS: "eds remove {file|FILE}",
    Action.LOG: "log {file|FILE}",
    Action.LOG_VALUES: "log {file|FILE} --decode",
    Action.READ_VALUES: "read {objects|OBJECT…} --every {time|TIME} {file?-o} {file}",
    Action.SAVE_PLAN: "plan FILE -o PLAN.json",
    Action.CONVERT: "eds convert {file|FILE} {target|TARGET} {services?--with} {services} {of?--for} {of} "
    "{plain?--plain}",
    Action.EXPORT: "export {file|FILE} {services?--with} {services} {twice?--twice}",
    Action.IMPORT: "import {file|FILE}",
    Action.BACKUP: "backup {file|FILE}",
    Action.SAVE_SCRIPT: "save {file|FILE.dvt} {all?--all} {history?--history}",
    Action.DECODE: "decode {file|FILE}",
    Action.DRAW: "report {file|NAME.html} {source}",
}
#: Actions that are an option for the typed line.
OPTIONS: dict[Action, str] = {
    Action.SELECT_CAN_ID: "--cob-id {can_id|auto}",
    Action.LEAVE_OFF: "--off",
    Action.EXTEND: "--extended",
    Action.FORBID_RTR: "--no-rtr",
    Action.ALLOW_RTR: "--rtr",
    Action.GIVE_EDS: "--eds {file|FILE}",
    Action.GIVE_PROFILE: "-p NAME",
    Action.GIVE_USER: "--user",
    Action.GIVE_CHANNEL: "-c/--channel {channel}",
    Action.GIVE_INTERFACE: "-i/--interface {interface}",
    Action.GIVE_BIT_RATE: "-b/--bitrate {rate}",
    Action.GIVE_BUS: "--bus {bus|NAME}",
    Action.GIVE_SIMULATED: "--sim {what|WHAT}",
    Action.GIVE_SETTING: "--bus-kwargs {setting|KEY=VALUE}",
    Action.GIVE_JOURNAL: "--journal DIR",
    Action.GIVE_TIMEOUT: "--timeout S",
    Action.GIVE_NAME: "--save",
    Action.GIVE_DBC: "-d {file}",
    Action.AGREE: "--yes",
    Action.FORCE: "--force",
    Action.SHOW_FRAMES: "-vv",
}
#: arguments with a different option name
_OPTION_OF = {
    "as_type": "--as", "bit_rate": "--at", "for_s": "--for",
    "node": "--for", "services": "--with", "node_id": "-n", "node_ids": "--nodes",
    "nodes": "--sim", "faults": "--fault", "signals": "--signal", "verbose": "-v", "timeout_s": "--timeout",
    "everything": "--all", "manager": "--to-manager",
}  # fmt: skip
#: arguments that are the path of a file
_FILES = frozenset({"file", "save", "target"})
#: words that look like an option and are no number
_OPTION = re.compile(r"-(?![\d.])")
#: commands about no node, or all nodes
_OF_THE_BUS = frozenset(
    {
        Action.FIND_NODES, Action.LINK, Action.CHECK_LIVE, Action.SHOW_LOAD, Action.CHECK_SYNC, Action.CHECK_SETUP,
        Action.SERVE, Action.LSS_SCAN, Action.LSS_SELECT, Action.LSS_STORE, Action.CHECK_EDS, Action.CHECK,
        Action.REMOVE_EDS, Action.ADD_EDS, Action.SHOW_EDS, Action.LIST_EDS, Action.CONVERT, Action.DECODE, Action.DRAW,
        Action.LSS_ASSIGN, Action.LSS_BIT_RATE, Action.LSS_IDENTIFY, Action.LSS_NODE_ID,
        Action.IMPORT, Action.SEND_SYNC, Action.SAVE_SCRIPT, Action.LOG,
        Action.LISTEN_BIT_RATE,
        Action.TRUST, Action.RECOVER_ALL, Action.APPLY_NETWORK,
    }
)  # fmt: skip
#: commands that need no bus
_WITHOUT_BUS = frozenset(
    {
        Action.SERVE, Action.CHECK, Action.CHECK_EDS, Action.REMOVE_EDS, Action.ADD_EDS, Action.SHOW_EDS,
        Action.LIST_EDS, Action.CONVERT,
        Action.TRUST,
    }
)  # fmt: skip
#: a placeholder for a word that only the user knows
PLACEHOLDER = (
    r"(?:ADDRESS|COUNT|FILE|HOST|ID|KEY|MS|NAME|NODE|NUMBER|OBJECT|PLAN|RATE|S|TARGET|TEXT|TIME|TYPE|VALUE|WHAT|WHEN)"
    r"(?:[:/=.]\w+)?…?|.*…"
)


class TypedCall(NamedTuple):
    """The call before a hint: its bus options, its `-n` options, and the selected node.

    *alone*: the next command is typed at a shell, not at the prompt. *script*: the file of the executed lines.
    """

    bus: tuple[str, ...] = ()
    node: tuple[str, ...] = ()
    selected: int | None = None
    alone: bool = False
    script: str = ""


@dataclass(slots=True, eq=False, repr=False)
class TypedHints:
    """Writes hints for the user of a call; *node* is the failed node."""

    call: Callable[[], TypedCall] = field(default=TypedCall)
    node: int | None = None

    def text(self, hint: Hint | str) -> str:
        """Return *hint* on one line, with marked commands."""
        return hint if isinstance(hint, str) else sentence(hint, self._marked)

    def words(self, hint: Hint) -> list[str] | None:
        """Return the words of the first complete command in *hint*; None if none."""
        lines = (self._line(step) for step in hint if step.action in COMMANDS)
        return next((line for line in lines if not any(re.fullmatch(PLACEHOLDER, word) for word in line)), None)

    def _marked(self, step: Hint) -> str:
        assert step.action is not None  # noqa: S101 - `sentence` asks for actions only
        write = shell_line if self.call().alone else prompt_line
        if step.action is Action.GIVE:
            return write(_given(step))
        if step.action in OPTIONS:
            option, *value = filled(OPTIONS[step.action], step.arguments)
            return write([option.split("/")[0] if value else option, *value])
        return f"`{write(self._line(step))}`"

    def _line(self, step: Hint) -> list[str]:
        """Return the command of a *step* as typed after this call."""
        if step.action is Action.VERIFY and "file" not in step.arguments and self.call().alone:
            step = self._shown(step)
        action = step.action
        assert action is not None  # noqa: S101 - as above
        said, call = COMMANDS[action], self.call()
        node = step.arguments.get("node", None if action in _OF_THE_BUS else self.node)
        if action is Action.DISABLE and "node" in step.arguments:  # it may be one that this call is not about
            return self._in_call(call, action, ["disable", f"{node}:{step.arguments['pdo']}"])
        given = {name: _no_option(name, value) for name, value in step.arguments.items()}
        if action is Action.CORRECT:  # what was typed, with its own options and node
            return self._in_call(call, action, [*_of_node(call, None), *filled(said, step.arguments)])
        words = _behind_options(filled(said, {"node": node, **given} if "{node}" in said else given), given)
        others = _of_node(call, node) if action not in _OF_THE_BUS and "{node}" not in said else ()
        return self._in_call(call, action, [*others, *words])

    def _shown(self, step: Hint) -> Hint:
        """For a program without a prompt, replace `verify` by a comparison with the script's file, else by `pdo`."""
        if script := self.call().script:
            return replace(step, arguments={**step.arguments, "file": script})
        return replace(step, action=Action.SHOW_PDOS)

    def _in_call(self, call: TypedCall, action: Action, words: list[str]) -> list[str]:
        """Return *words* after the bus options of *call*."""
        return ["dvtcli", *(() if action in _WITHOUT_BUS else call.bus), *words] if call.alone else words


def _given(step: Hint) -> list[str]:
    """Return the option for each argument of a *step*; without a value if None or true."""
    return [word for name, value in step.arguments.items() for word in _option(name, value)]


def _option(name: str, value: object) -> list[str]:
    """Return the option for the argument *name*, with its *value* unless None or true."""
    option = _OPTION_OF.get(name, f"--{'no-' if value is False else ''}{name.replace('_', '-')}")
    return [option] if value is None or isinstance(value, bool) else [option, str(value)]


def error_text(error: DvtcliError, text: str | None = None) -> str:
    """Return the text of *error*, or *text*, after its options."""
    options = " and ".join(" ".join(_option(name, value)) for name, value in error.given.items())
    said = error.text if text is None else text
    return f"{options}: {said}" if options else said


def _no_option(name: str, value: Any) -> Any:
    """Return *value*, protected from being read as an option if a file's path."""
    return f"./{value}" if name in _FILES and str(value).startswith("-") else value


def _behind_options(words: list[str], arguments: Mapping[str, Any]) -> list[str]:
    """Return *words*, with `--` before an object or value in *arguments* that begins like an option."""
    at = next((at for at, word in enumerate(words) if _OPTION.match(word) and word in map(str, _flat(arguments))), None)
    return words if at is None or words[at - 1].startswith("--") else [*words[:at], "--", *words[at:]]


def _flat(arguments: Mapping[str, Any]) -> Iterator[Any]:
    for value in arguments.values():
        yield from value if type(value) is tuple else (value,)


def _of_node(call: TypedCall, node: Any) -> Sequence[str]:
    """Return the words to select *node*, or the node of *call*."""
    if node is None or node == call.selected or (isinstance(node, int) and call.node == ("-n", str(node))):
        return call.node if call.alone else ()
    return ("-n", ",".join(map(str, node)) if type(node) in (tuple, list) else str(node))


def typed(hint: Hint | str | None) -> str:
    """Return *hint* as typed at the prompt, empty if none."""
    return TypedHints().text(hint) if hint else ""


def advised(finding: FileFinding) -> str:
    """Return the text of *finding* with its hint, in one line."""
    return f"{finding.text}; {typed(finding.hint)}" if finding.hint else finding.text


def prompt_line(words: Sequence[str]) -> str:
    """Return *words* as a line of the prompt or a script."""
    from shlex import quote

    return " ".join(word if _PLAIN.fullmatch(word) else quote(word) for word in words)


def shell_line(words: Sequence[str]) -> str:
    """Return *words* quoted as a shell line."""
    if sys.platform == "win32":
        from subprocess import list2cmdline

        return list2cmdline(words)
    return prompt_line(words)


#: characters without a meaning in a shell, and placeholders
_PLAIN = re.compile(r"[\w@%+=:,./…-]+")
