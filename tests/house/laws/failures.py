"""Law 7: errors end at one boundary, stand in one tree, and never turn into 0."""

from __future__ import annotations

import ast
import builtins
from collections.abc import Iterator

from tests.house.draw import nodes
from tests.house.laws.origins import named, origins
from tests.house.laws.source_tree import SourceTree, dotted

#: the program's end, the ends of processes that it starts, and a signal that was swallowed, sent to itself again
MAY_EXIT = (
    "__main__.py", "bus/drivers.py", "cli/boundary.py", "cli/dvt/tcl_child.py", "cli/dvt/tcl_child.py",
    "files/bounded_child.py", "files/dbc_child.py", "files/recordings/mdf.py",
    "cli/signals.py", "cli/screen/full_screen.py",
)  # fmt: skip
#: where a Ctrl-C that had to wait, or came by another way than a signal, goes on
MAY_INTERRUPT = (
    "cli/dvt/tcl_run.py", "cli/scripts/script.py", "cli/prompt/loop.py",
    "cli/conversation.py", "cli/each_node.py", "cli/live_lines.py",
    "operations/changes/store_restore.py", "operations/gateway/serve_gateway.py",
    "operations/api/calls.py",
)  # fmt: skip
#: where whatever happens must be turned into something else, with what for
MAY_CATCH_ALL = {
    "cli/boundary.py": "the one boundary",
    "cli/crash.py": "the bug itself is the news",
    "cli/dvt/tcl_child.py": "the end of a child, which its parent reads; what Tcl would swallow",
    "files/dbc_child.py": "the same, and what cantools raises",
    "files/recordings/mdf.py": "the same, and what asammdf raises",
    "bus/drivers.py": "what drivers raise means that they find nothing",
    "bus/turns.py": "handed to the thread that asked for the work",
    "operations/session/steady_listener.py": "handed to who takes what was heard",
    "cli/monitor/watch.py": "handed to who takes what was read",
    "cli/monitor/transmit_list.py": "handed to the screen, which raises it",
    "cli/editor/editor.py": "the same",
    "cli/screen/full_screen.py": "the same; and past the event loop of prompt_toolkit, which would keep it",
    "device/change/transaction.py": "LeftChanged follows, unless all but an object that cannot be read goes back",
    "device/change/roll_back.py": "the other changes are put back all the same, then it is raised",
}
#: where any failure of ours is left unsaid, with why
MAY_LEAVE_UNSAID = {
    "cli/conversation.py": "a script's failure is told; of what its earlier lines set nothing is claimed then",
    "cli/name_completion.py": "nothing is offered; it is said once the line is run",
    "cli/prompt/full_line.py": "the same",
    "cli/prompt/status.py": "the menu says less; the next command says why",
    "device/change/transaction.py": "who does not answer is not known to hold what it took",
    "operations/changes/change.py": "nobody knows: the store itself will say",
    "operations/exchange/import_network.py": "read ahead: it is said where it is needed",
    "operations/plans/plan_network.py": "the same",
    "operations/plans/resolve_names.py": "the same",
    "operations/lss/lss_bit_rate.py": "what failed first is said; it names who does not take the old bit rate",
    "operations/network/check_live.py": "without its links the file makes nothing to compare; its faults are said",
}
#: exceptions that end within their room and reach no user
INNER = {
    "files/network/yaml_tree.py:OtherYamlError",
    "files/recordings/recording_format.py:LostLineError", "files/recordings/recording_format.py:NoFrameError",
    "domain/gateway_words.py:GatewayRequestError",  # a client's line, which gets an answer
    "simulator/network/hub_client.py:RubbishError", "simulator/network/signals.py:RowsError",
    "simulator/device/memory.py:Refusal", "cli/dvt/tcl_calls.py:Exit", "cli/dvt/tcl_run.py:Late",
    "cli/dvt/tcl_calls.py:Ended", "cli/dvt/tcl_wire.py:WireError", "cli/dvt/tcl_wire.py:Gone",
    "cli/prompt/full_line.py:ThrownAway", "cli/prompt/full_line.py:Refused", "cli/view/streams.py:ReaderLeft",
    "domain/object_syntax.py:AmbiguousName",
    "domain/object_syntax.py:UnknownName",
}  # fmt: skip
_ENDS = frozenset(
    {
        "sys.exit", "os._exit", "exit", "quit", "SystemExit", "os.abort", "os.kill", "os.killpg", "signal.raise_signal",
        "_thread.interrupt_main", "atexit.register", "click.Abort", "click.exceptions.Abort", "click.exceptions.Exit",
    }
)  # fmt: skip
_ENDS |= {f"os.{how}" for how in ("execv", "execve", "execvp", "execvpe", "execl", "execle", "execlp", "execlpe")}
#: click's own ways out of a command
_CONTEXTS = ("ctx", "context", "click.get_current_context")
_HOOKS = ("sys.excepthook", "threading.excepthook", "sys.unraisablehook")
#: what is asked at the end of a `with`
_EXITS = ("__exit__", "__aexit__")
_ALL = {"Exception", "BaseException", "BaseExceptionGroup", "ExceptionGroup"}
_OURS = {"DvtcliError"}
#: ends of a command or of the program, which are nobody's to stop
_STOPS = {"KeyboardInterrupt", "SystemExit"}
#: builtin exceptions that say nothing of what failed
_BARE = frozenset({"Exception", "BaseException", "RuntimeError", "SystemError", "Warning"})
#: what makes a class without `class`
_MAKES = frozenset({"type", "types.new_class"})
_BUILTIN = {name for name, one in vars(builtins).items() if isinstance(one, type) and issubclass(one, BaseException)}


def ends_nowhere_else(tree: SourceTree) -> Iterator[str]:
    """Only the program itself exits."""
    for file, module in tree:
        if file in MAY_EXIT:
            continue
        harmless = _in_handlers(module)
        for node, names in named(module):
            if names & _ENDS and id(node) not in harmless:
                yield f"{file}:{node.lineno} {ast.unparse(node)}"
        for one in nodes(module):
            if _ends(module, one) or (file not in MAY_INTERRUPT and _interrupts(module, one)):
                yield f"{file}:{getattr(one, 'lineno', 0)} {ast.unparse(one)}"


def _ends(module: ast.Module, node: ast.AST) -> bool:
    """Whether it imports an end under whatever name, or asks click for one."""
    match node:
        case ast.ImportFrom(module=of, names=names):
            return bool({f"{of}.{one.name}" for one in names} & _ENDS)
        case ast.Attribute(attr="exit" | "abort", value=value):
            return bool(origins(module, value) & {*_CONTEXTS})
    return False


def _interrupts(module: ast.Module, node: ast.AST) -> bool:
    return isinstance(node, ast.Raise) and "KeyboardInterrupt" in _raised(module, node)


def _in_handlers(module: ast.Module) -> set[int]:
    """What only names the exceptions of `except`: `nothing_is_swallowed` looks at these."""
    kinds = [node.type for node in nodes(module) if isinstance(node, ast.ExceptHandler) and node.type is not None]
    return {id(inner) for kind in kinds for inner in ast.walk(kind)}


def _raised(module: ast.Module, node: ast.Raise) -> frozenset[str]:
    return frozenset() if node.exc is None else origins(module, node.exc)


def errors_stand_in_one_tree(tree: SourceTree) -> Iterator[str]:
    """A class of failures stands in `errors`, or is one of few that end where they begin. Nothing bare is raised."""
    classes = [
        (file, node, {name.rpartition(".")[2] for base in node.bases for name in origins(module, base)})
        for file, module in tree
        for node in nodes(module)
        if isinstance(node, ast.ClassDef)
    ]
    failures = {"DvtcliError", *_BUILTIN}
    while True:
        found = {node.name for _, node, bases in classes if bases & failures or _looks_like_one(node)}
        if found <= failures:
            break
        failures |= found
    for file, node, _ in classes:
        if node.name in failures and file != "errors.py" and f"{file}:{node.name}" not in INNER:
            yield f"{file}:{node.lineno} class {node.name}"
    for file, module in tree:
        for one in nodes(module):
            if isinstance(one, ast.Raise) and _raised(module, one) & _BARE:
                yield f"{file}:{one.lineno} {ast.unparse(one)}"
            elif (
                isinstance(one, ast.Call)
                and origins(module, one.func) & _MAKES
                and len(one.args) > 1
                and file != "errors.py"
            ):
                yield f"{file}:{one.lineno} makes a class without `class`"


def _looks_like_one(node: ast.ClassDef) -> bool:
    return any(dotted(base).endswith(("Error", "Exception")) for base in node.bases)


def nothing_is_swallowed(tree: SourceTree) -> Iterator[str]:
    """Who catches everything raises it again, or something else for it; who catches any of ours says it."""
    for file, module in tree:
        for node in nodes(module):
            line = f"{file}:{getattr(node, 'lineno', 0)}"
            if _may_answer(node):
                yield f"{line} may swallow what its block raises"
            elif isinstance(node, ast.Attribute) and dotted(node) in _HOOKS and file not in MAY_EXIT:
                yield f"{line} {dotted(node)}"
            else:
                yield from (f"{line} {said}" for said in _caught(file, module, node))


def _caught(file: str, module: ast.Module, node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.ExceptHandler):
        kinds = _kinds(module, [node.type] if node.type else [])
        if (node.type is None or kinds & _ALL) and file not in MAY_CATCH_ALL and not _raises(node.body):
            yield "catches everything"
        elif kinds & _OURS and file not in MAY_LEAVE_UNSAID and _says_nothing(node):
            yield "leaves any failure unsaid"
        elif kinds & _STOPS and file not in (*MAY_EXIT, *MAY_CATCH_ALL) and _says_nothing(node):
            yield "goes on after Ctrl-C, or the end"
    elif isinstance(node, ast.Call) and any(name.endswith("suppress") for name in origins(module, node.func)):
        kinds = _kinds(module, node.args)
        if kinds & (_ALL | _STOPS) or (kinds & _OURS and file not in MAY_LEAVE_UNSAID):
            yield "suppresses everything"


def _kinds(module: ast.Module, kinds: list[ast.expr]) -> set[str]:
    """The bare names of what is caught, whatever it is called here."""
    parts = [part for kind in kinds for part in (kind.elts if isinstance(kind, ast.Tuple) else [kind])]
    return {name.rpartition(".")[2] for part in parts for name in origins(module, part)}


def _raises(body: list[ast.stmt]) -> bool:
    """Whether each way through *body* ends with a `raise`."""
    match body[-1]:
        case ast.Raise():
            return True
        case ast.If(body=then, orelse=other):
            return bool(other) and _raises(then) and _raises(other)
        case ast.Match(cases=cases):
            return all(_raises(case.body) for case in cases)
        case ast.With(body=inner) | ast.Try(finalbody=inner) if inner:
            return _raises(inner)
    return False


def _says_nothing(node: ast.ExceptHandler) -> bool:
    """Whether the error goes nowhere: nothing is called, raised or kept."""
    kept = (ast.Raise, ast.Call, ast.AugAssign, ast.Yield)
    named = any(isinstance(inner, ast.Name) and inner.id == node.name for one in node.body for inner in ast.walk(one))
    return not named and not any(
        isinstance(inner, kept) or _keeps(inner) for one in node.body for inner in ast.walk(one)
    )


def _keeps(node: ast.AST) -> bool:
    """Whether *node* gives something a name that is read: not `_`."""
    names = [one.id if isinstance(one, ast.Name) else "" for one in getattr(node, "targets", ())]
    return isinstance(node, ast.Assign) and names != ["_"]


def _may_answer(node: ast.AST) -> bool:
    """Whether *node* makes an `__exit__` that may say so, or one of whatever is at hand."""
    if isinstance(node, ast.Assign):
        return bool({dotted(one) for one in node.targets} & {*_EXITS})
    return isinstance(node, ast.FunctionDef) and node.name in _EXITS and _answers(node)


def _answers(node: ast.FunctionDef) -> bool:
    """Whether an `__exit__` may answer that it took care of what was raised."""
    said = [inner.value for inner in ast.walk(node) if isinstance(inner, ast.Return) and inner.value is not None]
    return any(not (isinstance(value, ast.Constant) and not value.value) for value in said)
