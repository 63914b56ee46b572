"""Law 2: the plan is the only source of action, so few files send."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from tests.house.draw import nodes
from tests.house.laws.source_tree import SourceTree, dotted

#: what puts something on a bus
_SENDING = frozenset(
    {
        "download",
        "send",
        "send_nmt",
        "send_sdo",
        "send_message",
        "send_periodic",
        "send_request",
        "transmit",
        "send_sync",
        "canopen",
    }
)
_BY_NAME = ("getattr", "attrgetter", "methodcaller", "__getattribute__", "vars")
#: what sends, whatever is asked of it by a name that cannot be read
_WAYS_OUT = ("sdo", "bus", "wire", "access", "network", "transport")
#: the way to the bus, and the other end of it
_ROOMS = ("bus/", "simulator/")
#: the few that may, with what for
MAY_SEND = {
    "domain/ports.py": "the contract itself",
    "device/change/transaction.py": "plans",
    "device/change/put_back.py": "the way back",
    "device/store_parameters.py": "signatures of store and restore",
    "device/resets.py": "resets, under consent",
    "device/access_level.py": "logins",
    "device/nmt_gate.py": "the NMT gate, and the device's own state object",
    "device/seen_state.py": "the remote frame of node guarding",
    "device/lss_master.py": "LSS requests, and the reset that makes a node-ID count",
    "device/program_download.py": "program control and program data, under consent",
    "device/learn/saving.py": "signatures to 0x1010 that were agreed to, at most two",
    "device/learn/asking.py": "probes of what a device takes, whose way back is in a journal",
    "device/quirks/reversed_entries.py": "a plan's writes in the order of old firmware",
    "device/quirks/fixed_count.py": "a plan's writes with a count that stays",
    "device/error_history.py": "emptying the error history, and the position in a family's own list",
    "operations/sync/produce_sync.py": "SYNC",
    "operations/frames/put_on_bus.py": "what send and replay were told to send, under consent",
    "operations/pdos/look_at_frames.py": "SYNC, and the way back to STOPPED",
    "operations/nodes/command_nmt.py": "NMT commands",
    "operations/gateway/gateway_pdos.py": "the gateway's own TPDOs, under consent",
    "operations/api/canopen_access.py": "what canopen's user writes",
}


#: who may ask those of `device` that send: folders, or files
ASKED_BY: dict[str, tuple[str, ...]] = {
    "device/change/transaction.py": ("device/change/",),
    "device/change/put_back.py": (
        "device/",
        "operations/changes/",
        "operations/plans/apply_network.py",
        "cli/scripts/script_way_back.py",
    ),
    "device/resets.py": ("device/", "operations/nodes/command_nmt.py", "operations/stores/store_restore.py"),
    "device/access_level.py": (
        "device/",
        "operations/known_devices/learn_device.py",
        "operations/nodes/log_in.py",
        "cli/dvt/state.py",
    ),
    "device/nmt_gate.py": ("device/", "operations/nodes/command_nmt.py"),
    "device/lss_master.py": ("operations/lss/",),
    "device/program_download.py": ("operations/nodes/load_program.py",),
    "device/learn/saving.py": ("device/learn/", "operations/known_devices/learn_device.py"),
    "device/learn/asking.py": ("device/learn/",),
    "device/quirks/reversed_entries.py": ("device/",),
    "device/quirks/fixed_count.py": ("device/",),
    "device/error_history.py": ("operations/nodes/show_faults.py",),
    "operations/frames/put_on_bus.py": ("operations/frames/",),
}


def few_files_send(tree: SourceTree) -> Iterator[str]:
    """Nobody else sends: neither called, nor handed on, nor asked for by name, nor by who may."""
    for file, module in tree:
        if file.startswith(_ROOMS) or file in MAY_SEND:
            continue
        for node in nodes(module):
            if _sends(node):
                yield f"{file}:{getattr(node, 'lineno', 0)} {ast.unparse(node)}"
    for arrow in tree.house.arrows:
        if arrow.how != "type" and not arrow.source.startswith(ASKED_BY.get(arrow.target, (arrow.source,))):
            yield f"{arrow}: asks for what only {', '.join(ASKED_BY[arrow.target])} may"


def _sends(node: ast.AST) -> bool:
    match node:
        case ast.Attribute(attr=name, ctx=ast.Load()):
            return name in _SENDING or (name == "__dict__" and _is_way_out(node.value))
        case ast.MatchClass(kwd_attrs=names):
            return bool(_SENDING & {*names})
        case ast.Call(func=func, args=args) if dotted(func).endswith(_BY_NAME):
            words = {word.value for word in args if isinstance(word, ast.Constant)}
            subjects = [*args[:1], *([func.value] if isinstance(func, ast.Attribute) else [])]
            return bool(words & _SENDING) or (not words and any(map(_is_way_out, subjects)))
    return False


def _is_way_out(node: ast.expr) -> bool:
    """Whether *node* is, by its name, a bus or a dictionary on one: `node.sdo`, `type(node.sdo)`."""
    while isinstance(node, ast.Call) and dotted(node.func) == "type" and node.args:
        node = node.args[0]
    return dotted(node).rpartition(".")[2].lstrip("_") in _WAYS_OUT
