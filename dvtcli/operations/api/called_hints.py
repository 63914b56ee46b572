"""Hints as calls of this API: each action as the call that does it, or as an argument."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from dvtcli.domain.hint import Action, Hint, sentence

#: Actions -> the call; `node.` is that of another node where the hint names one. What has no call is a command.
CALLS: dict[Action, str] = {
    Action.SHOW_PDOS: "node.pdos()",
    Action.SHOW_NODE: "node.identity()",
    Action.FIND_NODES: "bus.scan()",
    Action.FIND_OBJECTS: "node.objects({text|TEXT})",
    Action.SHOW_MAPPABLE: "node.objects(mappable={direction})",
    Action.SHOW_FAULTS: "node.faults()",
    Action.VERIFY: "node.verify()",
    Action.MONITOR: "dvtcli monitor",
    Action.MAP: "node.map({pdo}, …{off? enabled=False})",
    Action.SET_PDO: "node.set({pdo}, …)",
    Action.CLEAR: "node.clear({pdo})",
    Action.DISABLE: "node.disable({pdo})",
    Action.WRITE: "node.write({object|OBJECT}, {value|VALUE})",
    Action.LINK: "bus.link({producer}, {consumer})",
    Action.UNDO: "node.undo({all?everything=True} {backup?backup=True} {force?force=True})",
    Action.RECOVER: "node.recover({accept?accept=True} {discard?discard=True})",
    Action.RECOVER_ALL: "bus.recover()",
    Action.FINISH_STORES: "bus.finish_stores()",
    Action.STORE: "node.store({what} {force?force=True})",
    Action.RESTORE: "node.restore({what})",
    Action.PROVE_STORE: "node.store({what} prove=True)",
    Action.PROVE_RESTORE: "node.restore({what} prove=True)",
    Action.PROVE_POWER: "node.store(prove='power'{within?, within_s=S})",
    Action.RESET_NODE: "node.nmt('reset-node')",
    Action.ENTER_PRE_OPERATIONAL: "node.nmt('preop')",
    Action.CHECK_LIVE: "bus.check()",
    Action.SHOW_LOAD: "bus.load()",
    Action.CHECK_SYNC: "bus.check_sync()",
    Action.CHECK_SETUP: "dvtcli doctor",
    Action.TRUST: "dvtcli trust",
    Action.LISTEN_BIT_RATE: "dvtcli bitrate",
    Action.SERVE: "dvtcli sim NODE… --listen HOST:PORT",
    Action.RUN: "dvtcli run FILE",
    Action.CHECK: "bus.check({file|FILE})",
    Action.PLAN: "bus.plan({file|FILE})",
    Action.APPLY: "bus.apply({file|FILE})",
    Action.COMPARE: "node.compare({file|FILE})",
    Action.LSS_SCAN: "bus.lss.scan({wait_s=})",
    Action.LSS_SELECT: "bus.lss.select(ADDRESS)",
    Action.LSS_STORE: "bus.lss.store()",
    Action.LSS: "bus.lss",
    Action.LOG_IN: "node.login()",
    Action.LEARN: "node.learn()",
    Action.CHECK_EDS: "dvtcli.check_eds({file|FILE})",
    Action.REMOVE_EDS: "dvtcli eds remove FILE",
    Action.LOG: "node.record(FILE)",
    Action.LOG_VALUES: "dvtcli log FILE --decode",
    Action.READ_VALUES: "dvtcli read OBJECT… --every TIME",
    Action.SAVE_PLAN: "dvtcli plan FILE -o PLAN",
    Action.SHOW_HABITS: "dvtcli profiles habits",
    Action.FORGET_HABITS: "dvtcli profiles forget",
    Action.DOWNLOAD: "node.download({file|FILE})",
    Action.FORGET_DOWNLOAD: "dvtcli download --forget",
}
#: Actions -> the argument of the same call, or of the one that opened the bus.
ARGUMENTS: dict[Action, str] = {
    Action.SELECT_CAN_ID: "cob_id={can_id|auto}",
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
    Action.GIVE_EMCY_TIME: "emcy_ms=",
    Action.GIVE_NAME: "save=",
    Action.GIVE_DBC: "dbc=FILE",
    Action.AGREE: "yes=True",
    Action.FORCE: "force=True",
    Action.SHOW_FRAMES: "`dvtcli -vv`",
    Action.ISOLATE: "isolated=True",
    Action.ALLOW_STORE: "with_store=True",
}
_FIELD = re.compile(r"\{(\w+)(?:(\?|=|\|)([^{}]*))?\}")


def called(hint: Hint) -> str:
    """*hint* in one line, its calls between marks."""
    return sentence(hint, _called)


def _called(step: Hint) -> str:
    assert step.action is not None  # noqa: S101 - `sentence` asks for actions only
    arguments = step.arguments
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


def _filled(template: str, arguments: Mapping[str, Any]) -> str:
    """*template* with the *arguments* as Python writes them; what is not given is left out, with its comma."""

    def value(found: re.Match[str]) -> str:
        name, mark, other = found[1], found[2], found[3]
        given = arguments.get(name)
        if mark == "?":
            return other if given else ""
        if given is None:
            return other if mark == "|" else ""
        said = repr(given) if isinstance(given, int) else repr(str(given))
        return f"{name}={said}" if mark == "=" else said

    text = re.sub(r" {2,}", " ", _FIELD.sub(value, template))
    text = re.sub(r"\( | \)", lambda edge: edge[0].strip(), text)
    return re.sub(r"(?<=[\w']) (?=\w+=)", ", ", text)
