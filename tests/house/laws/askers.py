"""Law 2: who may ask those that send. A file takes from them, by its imports, what sends nothing, or it stands here."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache

from tests.house.draw import nodes
from tests.house.laws.source_tree import SourceTree
from tests.house.laws.uses import ALL, STAR, Top, taken

#: who may ask each file that sends: folders, or files
ASKED_BY: dict[str, tuple[str, ...]] = {
    "device/change/transaction.py": ("device/change/",),
    "device/change/roll_back.py": ("device/",),
    "device/store/store_parameters.py": ("operations/changes/store_restore.py",),
    "device/resets.py": ("device/", "operations/nodes/command_nmt.py", "operations/changes/store_restore.py"),
    "device/access_level.py": ("device/", "operations/nodes/log_in.py", "cli/dvt/words.py"),
    "device/nmt_gate.py": ("device/",),
    "device/seen_state.py": (
        "device/",
        "operations/nodes/command_nmt.py",
        "operations/session/consent.py",
        "operations/plans/apply_network.py",
    ),
    "device/lss_master.py": ("operations/lss/",),
    "device/program_download.py": ("operations/nodes/load_program.py",),
    "device/learn/saving.py": ("device/learn/",),
    "device/learn/probing.py": ("operations/devices/learn_device.py",),
    "device/quirks.py": ("device/", "operations/exchange/import_network.py"),
    "device/error_history.py": ("operations/frames/show_faults.py",),
    "operations/pdos/produce_sync.py": ("cli/commands/sync.py", "operations/api/python_bus.py"),
    "operations/frames/put_on_bus.py": (
        "operations/frames/send_frames.py",
        "operations/frames/replay_recording.py",
        "cli/monitor/actions.py",
        "cli/monitor/transmit_list.py",
    ),
    "operations/pdos/look_at_frames.py": ("operations/devices/verify_nodes.py",),
    "operations/nodes/command_nmt.py": (
        "cli/commands/nmt.py",
        "cli/monitor/actions.py",
        "operations/api/python_node.py",
        "operations/gateway/gateway_work.py",
    ),
    "operations/gateway/gateway_pdos.py": ("operations/gateway/gateway_work.py",),
    "operations/api/canopen_access.py": ("operations/api/python_bus.py",),
}
#: what anybody may take from them, since it sends nothing: numbers, what was answered, and what only reads
HARMLESS: dict[str, frozenset[str]] = {
    "device/change/roll_back.py": frozenset({"PATIENCE_S", "RETRY_S", "first_difference"}),
    "device/store/store_parameters.py": frozenset({"SIGNATURES", "StoreAnswer", "chosen", "word_of"}),
    "device/access_level.py": frozenset({"RULES", "level_finding"}),
    "device/nmt_gate.py": frozenset({"NodeAccess"}),
    "device/seen_state.py": frozenset({"CONTROLWORDS", "STATUSWORDS", "heartbeat_ms", "heartbeat_slots", "is_guarded"}),
    "device/learn/saving.py": frozenset(
        {
            "SignatureAnswers",
            "not_asked",
            "read_storage",
            "storage_for_family",
            "storage_for_profile",
        }
    ),
}


def is_sender(top: Top) -> bool:
    """Whether asking for *top* may end in something sent."""
    file, name = top
    return file in ASKED_BY and name not in HARMLESS.get(file, ())


def asked_by_others(tree: SourceTree, file: str, module: ast.Module) -> Iterator[str]:
    """What *file* takes from those that send, also by way of a third, and may not."""
    lines: dict[int, set[Top]] = {}
    spelt = {node.attr for node in nodes(module) if isinstance(node, ast.Attribute)}
    for line, _, top in taken(tree, file, module):
        lines.setdefault(line, set()).update((top, *_handed_on(tree, top, spelt)))
    for arrow in tree.house.arrows_of(file):
        if arrow.how == "named":  # by a string, or by `dvtcli.device.x` spelt out: whatever it is that is asked for
            lines.setdefault(arrow.line, set()).add((arrow.target, ALL))
    for line, tops in sorted(lines.items()):
        for target, name in sorted(filter(is_sender, tops)):
            if file != target and not file.startswith(ASKED_BY[target]):
                yield f"{file}:{line} {name} of {target}: asks for what only {', '.join(ASKED_BY[target])} may"


def _handed_on(tree: SourceTree, top: Top, spelt: set[str]) -> set[Top]:
    """What the name is where another file only has it from a third; of a module whatever is *spelt*, of a star all."""
    file, name = top
    return {there for here, there in _all_taken(tree, file) if name in (here, STAR) or (name == ALL and here in spelt)}


@cache
def _all_taken(tree: SourceTree, file: str) -> tuple[tuple[str, Top], ...]:
    return tuple((here, top) for _, here, top in taken(tree, file, tree.parsed(file)))
