"""Law 7: errors end at one boundary, stand in one tree, and never turn into 0."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from typing import TypeGuard

from tests.house.draw import nodes
from tests.house.laws.source_tree import SourceTree, dotted

#: the program's end, the ends of processes that it starts, and a signal that was swallowed, sent to itself again
_MAY_EXIT = (
    "__main__.py", "bus/drivers.py", "cli/dvt/tcl_child.py", "cli/dvt/tcl_parent.py", "cli/stop_signals.py"
)  # fmt: skip
#: where whatever happens must be turned into something else, with what for
_MAY_CATCH_ALL = {
    "cli/boundary.py": "the one boundary",
    "cli/dvt/tcl_child.py": "the end of a child, which its parent reads",
    "cli/dvt/tcl_child_run.py": "the same, where Tcl would swallow it",
    "bus/drivers.py": "what drivers raise means that they find nothing",
    "bus/turns.py": "handed to the thread that asked for the work",
    "device/change/put_back.py": "the other changes are put back all the same, then it is raised",
}
#: where results and messages become text
_MAY_PRINT = {"cli/view/output.py": "the one place", "bus/drivers.py": "a child's answer to its parent"}
#: exceptions that end within their room and reach no user
INNER = {
    "domain/gateway/error_numbers.py:GatewayRequestError",  # a client's line, which gets an answer
    "simulator/network/socketcand.py:RubbishError", "simulator/device/signal_shapes.py:RowsError",
    "simulator/device/refusal.py:Refusal", "cli/dvt/tcl_safe.py:Exit", "cli/dvt/tcl_process.py:Late",
    "cli/dvt/tcl_calls.py:Ended", "cli/dvt/tcl_wire.py:WireError", "cli/dvt/tcl_wire.py:Gone",
    "cli/prompt/key_bindings.py:ThrownAway", "cli/prompt/checking.py:Refused", "cli/view/streams.py:ReaderLeft",
    "domain/object_syntax.py:UnknownName",
}  # fmt: skip
_ENDS = {"sys.exit", "os._exit", "exit", "quit", "SystemExit", "os.abort", "os.kill"}
_ALL = {"Exception", "BaseException"}


def ends_nowhere_else(tree: SourceTree) -> Iterator[str]:
    """Only the program itself exits."""
    for file, module in tree:
        for node in nodes(module):
            if file not in _MAY_EXIT and _ends(node):
                yield f"{file}:{node.lineno} {ast.unparse(node)}"


def _ends(node: ast.AST) -> TypeGuard[ast.stmt | ast.expr]:
    match node:
        case ast.Call():
            return dotted(node) in _ENDS
        case ast.Raise(exc=ast.Name(id="SystemExit")):
            return True
        case ast.ImportFrom():
            return bool({f"{node.module}.{one.name}" for one in node.names} & _ENDS)
    return False


def errors_stand_in_one_tree(tree: SourceTree) -> Iterator[str]:
    """A class of failures stands in `errors`, or is one of the few that end where they begin."""
    classes = [(file, node) for file, module in tree for node in nodes(module) if isinstance(node, ast.ClassDef)]
    failures = {"DvtcliError", "KeyboardInterrupt", "SystemExit", *_ALL}
    while True:
        found = {node.name for _, node in classes if _bases(node) & failures or _looks_like_one(node)}
        if found <= failures:
            break
        failures |= found
    for file, node in classes:
        if node.name in failures and file != "errors.py" and f"{file}:{node.name}" not in INNER:
            yield f"{file}:{node.lineno} class {node.name}"


def _bases(node: ast.ClassDef) -> set[str]:
    return {dotted(base).rpartition(".")[2] for base in node.bases}


def _looks_like_one(node: ast.ClassDef) -> bool:
    return any(base.endswith(("Error", "Exception")) for base in _bases(node))


def nothing_is_swallowed(tree: SourceTree) -> Iterator[str]:
    """Who catches everything raises it again, or something else for it."""
    for file, module in tree:
        if file in _MAY_CATCH_ALL:
            continue
        for node in nodes(module):
            if isinstance(node, ast.ExceptHandler) and _catches_all(node.type):
                if not any(isinstance(inner, ast.Raise) for inner in ast.walk(node)):
                    yield f"{file}:{node.lineno} catches everything"
            elif _is_suppress(node) and any(_catches_all(kind) for kind in node.args):
                yield f"{file}:{node.lineno} suppresses everything"


def _is_suppress(node: ast.AST) -> TypeGuard[ast.Call]:
    return isinstance(node, ast.Call) and dotted(node.func).endswith("suppress")


def _catches_all(kind: ast.expr | None) -> bool:
    if kind is None:
        return True
    parts = kind.elts if isinstance(kind, ast.Tuple) else [kind]
    return any(dotted(part).rpartition(".")[2] in _ALL for part in parts)


def only_view_prints(tree: SourceTree) -> Iterator[str]:
    """Results and messages become text at one place."""
    for file, module in tree:
        for node in nodes(module):
            if not isinstance(node, ast.Call) or file in _MAY_PRINT:
                continue
            called = dotted(node.func)
            if called in ("print", "builtins.print", "pprint", "pprint.pprint", "click.echo", "click.secho") or (
                called.startswith(("sys.stdout.", "sys.stderr.")) and called.endswith((".write", ".writelines"))
            ):
                yield f"{file}:{node.lineno} {called}"
