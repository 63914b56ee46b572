"""Possible next steps for the user, as data without command-line words: an action, its arguments, its purpose."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any


class Action(Enum):
    """Possible next actions, for any way of using dvtcli; the value describes the action in words."""

    # looking at a node
    SHOW_PDOS = "show the PDOs"
    SHOW_NODE = "show the node"
    FIND_NODES = "find the nodes"
    FIND_OBJECTS = "search the objects"
    SHOW_MAPPABLE = "show what can be mapped"
    SHOW_FAULTS = "show the faults"
    VERIFY = "compare with the configured values"
    MONITOR = "watch the values"
    # changing PDOs
    MAP = "map objects into the PDO"
    SET_PDO = "set the PDO's parameters"
    CLEAR = "clear the PDO"
    ENABLE = "enable the PDO"
    DISABLE = "disable the PDO"
    SELECT_CAN_ID = "take a free CAN-ID"
    LEAVE_OFF = "leave the PDO off"
    EXTEND = "take a CAN-ID of 29 bits"
    FORBID_RTR = "forbid remote frames"
    ALLOW_RTR = "allow remote frames"
    READ = "read the object"
    WRITE = "write the object"
    EDIT_PDO = "edit the PDO"
    SHOW_VPDO = "show the virtual PDO"
    LINK = "link the PDOs"
    CORRECT = "write the line in a valid form"
    # going back
    UNDO = "undo the last change"
    RECOVER = "recover the node"
    RECOVER_ALL = "recover every node"
    FINISH_STORES = "finish the stores"
    # keeping
    STORE = "store the parameters"
    RESTORE = "restore the defaults"
    PROVE_STORE = "store, and compare after a reset"
    PROVE_RESTORE = "restore, and compare after a reset"
    PROVE_POWER = "store, and compare after a power cycle"
    # the network
    RESET_NODE = "reset the node"
    RESET_COMMUNICATION = "reset the communication"
    START_NODE = "start the node"
    SEND_SYNC = "send SYNC"
    ENTER_PRE_OPERATIONAL = "enter PRE-OPERATIONAL"
    CHECK_LIVE = "check the network on the bus"
    SHOW_LOAD = "show the bus load"
    CHECK_SYNC = "compare with the SYNC producer"
    CHECK_SETUP = "check bus and computer"
    TRUST = "trust the settings file"
    LISTEN_BIT_RATE = "listen for the bit rate"
    SERVE = "serve simulated nodes"
    RUN = "run the script"
    CHECK = "check the file"
    PLAN = "plan the network"
    APPLY = "apply the file"
    APPLY_NETWORK = "apply the network file"
    COMPARE = "compare with the file"
    LSS_SCAN = "find the nodes without node-ID"
    LSS_SELECT = "select a node by its LSS address"
    LSS_STORE = "store the node-ID"
    LSS_ASSIGN = "give every node its node-ID"
    LSS_BIT_RATE = "change the bit rate"
    LSS_IDENTIFY = "ask for the LSS address"
    LSS_NODE_ID = "give a node-ID"
    LOG_IN = "log in"
    LEARN = "learn the device"
    # files
    CHECK_EDS = "check the device file"
    ADD_EDS = "add the file to the library"
    SHOW_EDS = "show the device file"
    LIST_EDS = "list the library"
    REMOVE_EDS = "remove the file from the library"
    LOG = "record the frames"
    LOG_VALUES = "record the values"
    READ_VALUES = "read the values again and again"
    SAVE_PLAN = "save the plan"
    CONVERT = "convert the file"
    EXPORT = "export the node"
    IMPORT = "write the network to a file"
    BACKUP = "back the node up"
    SAVE_SCRIPT = "save the changes as a script"
    DECODE = "decode the recording"
    DRAW = "draw the network"
    # options of the same call
    GIVE = "add the argument"
    GIVE_EDS = "name the EDS"
    GIVE_PROFILE = "name the profile"
    GIVE_USER = "name the user"
    GIVE_CHANNEL = "name the channel"
    GIVE_INTERFACE = "name the interface"
    GIVE_BIT_RATE = "name the bit rate"
    GIVE_BUS = "name the bus"
    GIVE_SIMULATED = "simulate a node"
    GIVE_SETTING = "give a setting of the interface"
    GIVE_JOURNAL = "name the folder of journals"
    GIVE_TIMEOUT = "wait longer"
    GIVE_NAME = "save it under another name"
    GIVE_DBC = "name the DBC file"
    AGREE = "answer yes"
    FORCE = "do it all the same"
    SHOW_FRAMES = "show the frames"


@dataclass(frozen=True, slots=True)
class Hint:
    """A next step: *action* with its *arguments* (`node` is a node-ID), and its purpose *why*.

    The action replaces `{}` in *why* (without marks if at the end behind a colon), else it comes in front. Text
    from outside, such as a path, must pass `verbatim` first. Without an action *why* is advice, printed as it is.
    `+` chains steps.
    """

    action: Action | None
    arguments: Mapping[str, Any] = field(default_factory=dict, hash=False)
    why: str = ""
    then: Hint | None = None

    def __iter__(self) -> Iterator[Hint]:
        """The steps, in order."""
        yield self
        if self.then is not None:
            yield from self.then

    def __add__(self, other: Hint | str) -> Hint:
        """This step, then *other*."""
        return replace(self, then=as_hint(other) if self.then is None else self.then + other)

    def __radd__(self, other: str) -> Hint:
        """Advice, then this step."""
        return as_hint(other) + self

    def after(self, first: Hint | None) -> Hint:
        """This step, once *first* is done."""
        if first is None:
            return self
        if self.action is None:
            return first + replace(self, why=f"then {self.why}".rstrip())
        return first + replace(self, why=f"then {self.why if has_place(self.why) else f'{{}} {self.why}'.rstrip()}")

    def begins_with(self, other: Hint) -> bool:
        """Whether the first step equals the first step of *other*."""
        return replace(self, then=None) == replace(other, then=None)

    def words(self) -> str:
        """The hint in words, without commands or calls."""
        return sentence(self, lambda step: step.action.value if step.action else "")

    __str__ = words


def as_hint(hint: Hint | str) -> Hint:
    """*hint* as a Hint; a text becomes advice."""
    return Hint(None, why=hint) if isinstance(hint, str) else hint


def verbatim(text: object) -> str:
    """Escape *text* from outside for the `why` of a hint with an action: its braces are printed as they are."""
    return str(text).replace("{", "{{").replace("}", "}}")


def has_place(why: str) -> bool:
    """Whether *why* has a place for its action."""
    return "{}" in _BRACES.findall(why)


def sentence(hint: Hint, write: Callable[[Hint], str]) -> str:
    """All steps of *hint* in one line; *write* returns the words for a step's action."""
    text = ""
    for step in hint:
        said = step.why if step.action is None else _placed(step.why, write(step))
        text += said if not text or said[:1] in (",", " ", ";") else f"; {said}"
    return text


#: a brace that is printed, and the place of the action
_BRACES = re.compile(r"\{\{|\}\}|\{\}")


def _placed(why: str, action: str) -> str:
    """*why* with its *action*, and with braces doubled by `verbatim` restored."""
    if why.endswith(": {}"):
        action = action.strip("`")
    if not has_place(why):
        why = f"{{}} {why}"
    said = {"{{": "{", "}}": "}", "{}": action}
    return _BRACES.sub(lambda found: said[found[0]], why).rstrip()


@dataclass(frozen=True, slots=True)
class NextStep:
    """The `next` field of a document: the first runnable step of *hint*, in words."""

    hint: Hint


def next_step(hint: Hint | str | None) -> NextStep | None:
    """The `next` field of a document with *hint*."""
    return NextStep(hint) if isinstance(hint, Hint) else None


def plain_json(value: object) -> str | None:
    """JSON for a hint in a kept document: its words; null for a command, as a command is valid for one call only."""
    if isinstance(value, NextStep):
        return None
    if isinstance(value, Hint):
        return value.words()
    raise TypeError(f"{type(value).__name__} is not JSON")


def filled(template: str, arguments: Mapping[str, Any]) -> list[str]:
    """Fill *template* with *arguments*, as words.

    `{name}` is an argument's value, or each of several; without the argument the word is left out; `{name?word}` is the
    word if the argument is true; `{name|WORD}` is the value, or the placeholder WORD.
    """
    found: list[str] = []
    for word in template.split():
        name, mark, other = word.strip("{}").partition("?") if "?" in word else word.strip("{}").partition("|")
        if word[:1] != "{":
            found.append(word)
        elif mark == "?":
            found += [other] if arguments.get(name) not in (None, False) else []
        elif (value := arguments.get(name)) is not None:
            found += map(str, value if type(value) is tuple else (value,))
        elif mark:
            found.append(other)
    return found
