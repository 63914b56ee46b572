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
    }
)
_BY_NAME = ("getattr", "attrgetter", "methodcaller")
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


def few_files_send(tree: SourceTree) -> Iterator[str]:
    """Nobody else sends: neither called, nor handed on, nor asked for by name."""
    for file, module in tree:
        if file.startswith(_ROOMS) or file in MAY_SEND:
            continue
        for node in nodes(module):
            if isinstance(node, ast.Attribute) and node.attr in _SENDING and isinstance(node.ctx, ast.Load):
                yield f"{file}:{node.lineno} {ast.unparse(node)}"
            elif isinstance(node, ast.Call) and dotted(node.func).endswith(_BY_NAME):
                words = {word.value for word in node.args if isinstance(word, ast.Constant)}
                if words & _SENDING:
                    yield f"{file}:{node.lineno} {ast.unparse(node)}"
