"""What each command of a hint promises: an example of it, what it prints, and what is so on the node afterwards."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from typing import Any

from dvtcli.cli.view.typed_hints import COMMANDS
from dvtcli.domain.hint import Action

A = Action


@dataclass(frozen=True)
class Promise:
    """What a command is to print; `{0}` is its first argument, as what has no digits behind its point prints it.

    *then*: a line after it, which is to print that instead. Of the example *given* are the arguments, *before* the
    lines in front of it, on the nodes *sim*, and *after* lines behind it, of which the last prints the text after it.
    """

    prints: str
    then: str = ""
    given: dict[str, Any] = field(default_factory=dict)
    before: tuple[str, ...] = ()
    sim: tuple[str, ...] = ("gen4",)
    after: tuple[str, ...] = ()


T50 = "set tpdo1 --timer 50"
TWO = ("generic@1", "generic@5")
#: files that the examples find in their folder
FILES = {
    "one.yaml": "nodes: {a: {node_id: 1, tpdo: {1: {event_timer: 50}}}}\n",
    "s.dvt": "set tpdo1 --timer 50\n",
    "r.log": "(1.0) can0 081#0010010000000000\n",
    "lss.yaml": "nodes: {a: {node_id: 1, identity: {vendor: 0, product: 0x301, revision: 0x10000, serial: 1}}}\n",
    "dvtcli.toml": "timeout = 2\n",
}
PROMISES = {
    A.SHOW_PDOS: Promise(r"(?i)[rt]pdo\d", given={"pdo": "tpdo1"}),
    A.SHOW_NODE: Promise(r"node \d+ .*\n +device type", given={"node": 1}),
    A.FIND_NODES: Promise(r"NODE +STATE.*(PRE-OP|OP ).*nodes? on ", sim=TWO),
    A.FIND_OBJECTS: Promise(r"606C:00", given={"text": "606C"}),
    A.SHOW_MAPPABLE: Promise(r"OBJECT(?:(?!\bno\n).)*MAPPABLE", given={"direction": "tpdo"}),
    A.SHOW_FAULTS: Promise(r"error register 0x"),
    A.VERIFY: Promise(r"equal to|differ", given={"file": "h.dcf"}, before=("export h.dcf",)),
    A.CORRECT: Promise("event +50 ms", "pdo tpdo1", {"words": ("set", "tpdo1", "--timer", "50")}),
    A.MAP: Promise(r"(?i){1}(:00)? ", "pdo {0}", {"pdo": "tpdo2", "objects": ("6041",), "off": True}),
    A.CLEAR: Promise('"enabled":false.*"mapping":\\[\\]', "pdo {0} --json", {"pdo": "tpdo1"}),
    A.ENABLE: Promise('"enabled":true', "pdo {0} --json", {"pdo": "tpdo1"}, before=("disable tpdo1",)),
    A.DISABLE: Promise('"enabled":false', "pdo {0} --json", {"pdo": "tpdo1"}),
    A.SET_PDO: Promise("{1}", "pdo {0}", {"pdo": "tpdo1", "cob_id": "0x191"}),
    A.READ: Promise(r"0x{0}:00 .* = ", given={"object": "1017"}),
    A.WRITE: Promise(r"{1}", "read {0}", {"object": "1017", "value": "0x0064"}),
    A.SHOW_VPDO: Promise(r"{0} +1 +0x2020", given={"group": "motor"}),
    A.LINK: Promise('"cob_id":385', "pdo {1} --json", {"producer": "1:tpdo1", "consumer": "5:rpdo1"}, sim=TWO),
    A.UNDO: Promise("event +0 ms", "pdo tpdo1", before=(T50,)),
    A.RECOVER: Promise("nothing to recover"),
    A.RECOVER_ALL: Promise("nothing to recover"),
    A.FINISH_STORES: Promise("nothing to recover"),
    A.STORE: Promise("stored, acknowledged", before=(T50,), after=("nmt reset-node 1", "pdo tpdo1", "event +50 ms")),
    A.RESTORE: Promise(
        "restored, acknowledged", before=(T50, "store"), after=("nmt reset-node 1", "pdo tpdo1", "event +0 ms")
    ),
    A.PROVE_STORE: Promise("proved: after the reset"),
    A.PROVE_RESTORE: Promise("proved: after the reset"),
    A.RESET_NODE: Promise("event +0 ms", "pdo tpdo1", {"node": 1}, (T50,)),
    A.RESET_COMMUNICATION: Promise("event +0 ms", "pdo tpdo1", {"node": 1}, (T50,)),
    A.START_NODE: Promise(r" 1 +OP ", "scan", {"node": 1}),
    A.ENTER_PRE_OPERATIONAL: Promise(r" 1 +PRE-OP ", "scan", {"node": 1}, ("nmt start 1",)),
    A.SEND_SYNC: Promise("{1} SYNCs sent", given={"period": 20, "count": 3}),
    A.CHECK_LIVE: Promise("sim: ", sim=TWO),
    A.SHOW_LOAD: Promise("0x081 +EMCY"),
    A.CHECK_SYNC: Promise("on the bus: "),
    A.CHECK_SETUP: Promise("ok +packages"),
    A.TRUST: Promise("dvtcli.toml"),
    A.RUN: Promise("event +50 ms", "pdo tpdo1", {"file": "s.dvt"}),
    A.CHECK: Promise("{0}: 1 node", given={"file": "one.yaml"}),
    A.PLAN: Promise("Plan: 1 PDO change", given={"file": "one.yaml"}),
    A.APPLY: Promise("event +50 ms", "pdo tpdo1", {"file": "one.yaml"}),
    A.APPLY_NETWORK: Promise("event +50 ms", "pdo tpdo1", {"file": "one.yaml"}),
    A.COMPARE: Promise("differ|equal to {0}", given={"file": "h.dcf"}, before=("export h.dcf", T50)),
    A.LSS_SCAN: Promise("no node without a node-ID answers"),
    A.LSS_STORE: Promise("node 1 .* stored", sim=("generic",)),
    A.LSS_ASSIGN: Promise("has its node-ID", given={"file": "lss.yaml"}, sim=("generic",)),
    A.LSS_BIT_RATE: Promise("at 500000 bit/s", given={"rate": 500000}, sim=("generic",)),
    A.LSS_IDENTIFY: Promise("no node without a node-ID answers"),
    A.LOG_IN: Promise("at access level 4", given={"level": 1}),
    A.LEARN: Promise("pump", "profiles", {"save": "pump"}),
    A.CHECK_EDS: Promise("0 errors", given={"file": "h.dcf"}, before=("export h.dcf",)),
    A.ADD_EDS: Promise("h.dcf", "eds list", {"file": "h.dcf"}, ("export h.dcf",)),
    A.SHOW_EDS: Promise("vendor +Sevcon", given={"file": "h.dcf"}, before=("export h.dcf",)),
    A.LIST_EDS: Promise("h.dcf|library is empty", before=("export h.dcf", "eds add h.dcf")),
    A.REMOVE_EDS: Promise("0 files", given={"file": 1}, before=("export h.dcf", "eds add h.dcf")),
    A.CONVERT: Promise("read back", given={"file": "h.dcf", "target": "h.xdc"}, before=("export h.dcf",)),
    A.EXPORT: Promise(
        "{0}: 1 node", given={"file": "a.dbc", "services": "emcy"}, after=("decode r.log -d a.dbc", "Error_code")
    ),
    A.IMPORT: Promise("{0}: 1 node", "check {0}", {"file": "net.yaml"}),
    A.BACKUP: Promise("equal to {0}", "compare {0}", {"file": "b.jsonl"}),
    A.SAVE_SCRIPT: Promise("equal to", "verify {0}", {"file": "x.dvt"}, (T50,)),
    A.DECODE: Promise("EMCY", given={"file": "r.log"}),
    A.DRAW: Promise("n.html: sim, 1 node", given={"file": "n.html"}),
}


@dataclass(frozen=True)
class Interrupted:
    """What a way out of a change of nodes 5 and 9 is to print, and whether all are *as before* then."""

    prints: str
    is_as_before: bool


_BOTH_BACK = "node 5 rolled back: .*, read back equal.* node 9 rolled back: .*, read back equal"
#: the same of a change, or of stores, that were really interrupted
INTERRUPTED = {
    A.RECOVER: Interrupted(_BOTH_BACK, is_as_before=True),
    A.RECOVER_ALL: Interrupted(_BOTH_BACK, is_as_before=True),
    A.FINISH_STORES: Interrupted("is complete: node 9 stored", is_as_before=False),
}
#: commands that end with Ctrl-C, with a terminal, a power switch or a real bus only, or that only a user can complete
NOT_HERE = {
    A.MONITOR, A.LISTEN_BIT_RATE, A.SERVE, A.LOG, A.LOG_VALUES, A.READ_VALUES, A.EDIT_PDO, A.PROVE_POWER,
    A.LSS_SELECT, A.LSS_NODE_ID, A.SAVE_PLAN,
}  # fmt: skip


def action_of(words: list[str]) -> tuple[Action, list[str]]:
    """The action whose command has most of *words*, which stand behind those of the bus, and its other words."""
    found = max(
        (action for action in COMMANDS if _literal(action) == words[: len(_literal(action))]),
        key=lambda action: (len(_literal(action)), len(set(_flags(action)) & set(words))),
    )
    return found, [word for word in words[len(_literal(found)) :] if not word.startswith("-")]


def _literal(action: Action) -> list[str]:
    """The words of a command up to its first argument."""
    words = COMMANDS[action].split()
    return words[: next((at for at, word in enumerate(words) if word[0] in "{" or word.isupper()), len(words))]


def _flags(action: Action) -> list[str]:
    return [word for word in COMMANDS[action].split() if word.startswith("--")]


def behind_the_bus(command: str) -> list[str]:
    """The words of a printed *command* behind `dvtcli` and the options that choose bus and node."""
    words = shlex.split(command)[1:]
    while words[0] in ("--sim", "-n"):
        words = words[2:]
    return words
