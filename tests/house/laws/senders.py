"""Law 2: the plan is the only source of action, so few files send."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from tests.house.draw import nodes
from tests.house.laws.askers import asked_by_others
from tests.house.laws.origins import origins
from tests.house.laws.source_tree import SourceTree, dotted

#: what puts something on a bus
_SENDING = frozenset(
    {
        "download", "send", "send_nmt", "send_sdo", "send_message", "send_periodic", "send_request", "transmit",
        "send_sync", "canopen",
    }
)  # fmt: skip
_BY_NAME = frozenset({"getattr", "attrgetter", "methodcaller", "__getattribute__", "vars", "getmembers"})
#: what makes a way to any name, which must be read here
_MADE = frozenset({"attrgetter", "methodcaller"})
#: what sends, whatever is asked of it by a name that cannot be read
_WAYS_OUT = ("sdo", "bus", "wire", "access", "network", "transport")
#: the way to the bus, and the other end of it
_ROOMS = ("bus/", "simulator/")
#: the few that may, with what for
MAY_SEND = {
    "domain/ports.py": "the contract itself",
    "device/change/transaction.py": "plans",
    "device/change/roll_back.py": "the roll-back",
    "device/store/store_parameters.py": "signatures of store and restore",
    "device/resets.py": "resets, under consent",
    "device/access_level.py": "logins",
    "device/nmt_gate.py": "the NMT gate, and the device's own state object",
    "device/seen_state.py": "the remote frame of node guarding",
    "device/lss_master.py": "LSS requests, and the reset after which a node-ID is valid",
    "device/program_download.py": "program control and program data, under consent",
    "device/learn/saving.py": "signatures to 0x1010 that were agreed to, at most two",
    "device/learn/probing.py": "probes of what a device accepts, with a journal for the roll-back",
    "device/quirks.py": "a plan's writes in the order of old firmware, or with a count that stays",
    "device/error_history.py": "emptying the error history, and the position in a family's own list",
    "operations/pdos/produce_sync.py": "SYNC",
    "operations/frames/put_on_bus.py": "what send and replay were told to send, under consent",
    "operations/pdos/look_at_frames.py": "SYNC, and the return to STOPPED",
    "operations/nodes/command_nmt.py": "NMT commands",
    "operations/gateway/gateway_pdos.py": "the gateway's own TPDOs, under consent",
    "operations/api/canopen_access.py": "what canopen's user writes",
}


def few_files_send(tree: SourceTree) -> Iterator[str]:
    """Nobody else sends: neither called, nor handed on, nor asked for by name, nor by who may."""
    for file, module in tree:
        if file.startswith(_ROOMS) or file in MAY_SEND:
            continue
        for node in nodes(module):
            if _sends(module, node):
                yield f"{file}:{getattr(node, 'lineno', 0)} {ast.unparse(node)}"
        yield from asked_by_others(tree, file, module)


def _sends(module: ast.Module, node: ast.AST) -> bool:
    match node:
        case ast.Attribute(attr=name, value=value, ctx=ast.Load()):
            return name in _SENDING or (name == "__dict__" and _is_way_out(module, value))
        case ast.MatchClass(kwd_attrs=names):
            return bool(_SENDING & {*names})
        case ast.Call(func=func, args=args):
            called = {name.rpartition(".")[2] for name in origins(module, func)}
            words = {word.value for word in args if isinstance(word, ast.Constant)}
            if called & _MADE and args and not words:
                return True
            subjects = [*args[:1], *([func.value] if isinstance(func, ast.Attribute) else [])]
            asked = any(_is_way_out(module, one) for one in subjects)
            return bool(called & _BY_NAME) and (bool(words & _SENDING) or (not words and asked))
    return False


def _is_way_out(module: ast.Module, node: ast.expr) -> bool:
    """Whether *node* is, by its name, a bus or a dictionary on one: `node.sdo`, `type(node.sdo)`, `s = node.sdo`."""
    while isinstance(node, ast.Call) and dotted(node.func) == "type" and node.args:
        node = node.args[0]
    names = {name.removesuffix(".__class__").rpartition(".")[2] for name in origins(module, node)}
    return any(name.lstrip("_") in _WAYS_OUT for name in names)
