"""Law 8: results and messages become text, and questions are asked, at one place."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from typing import TypeGuard

from tests.house.draw import nodes
from tests.house.laws.origins import named
from tests.house.laws.source_tree import SourceTree

#: where they become text, and where else the program's own streams are in hand, with what for
MAY_PRINT = {
    "cli/view/output.py": "the one place",
    "bus/drivers.py": "a child's answer to its parent",
    "bus/driver_parts.py": "a child's answer to its parent",
    "__main__.py": "streams that are closed are given to nobody",
    "cli/boundary.py": "a stream that nobody reads any more is silenced",
    "cli/crash.py": "the report of a bug, into a file",
    "operations/api/calls.py": "the log of the Python API",
    "cli/passcode.py": "asks for what must not be seen",
    "cli/prompt/first_start.py": "asks at a terminal how to go on",
    "cli/prompt/loop.py": "the prompt, and what would be printed over it",
    "cli/prompt/line.py": "what the user sends on to a file or a program",
    "cli/commands/tour.py": "waits for Enter",
    "cli/commands/_pdo_edit.py": "the user's editor",
    "files/bounded_child.py": "a pipe to its parent",
    "files/dbc_child.py": "a pipe to its parent",
    "files/recordings/mdf.py": "the same",
    "cli/signals.py": "what a signal is answered with, without waiting",
}
_SAYING = frozenset(
    {
        "print", "input", "pprint", "click.echo", "click.secho", "click.confirm", "click.prompt", "click.pause",
        "click.getchar",
        "os.writev", "sys.displayhook", "breakpoint", "help", "click.echo_via_pager",
        "click.edit", "warnings.warn", "os.write", "getpass.getpass",
    }
)  # fmt: skip
_MODULES = ("logging.", "traceback.print", "pprint.", "contextlib.redirect_", "rich.")
_STREAMS = frozenset({"sys.stdout", "sys.stderr", "sys.__stdout__", "sys.__stderr__"})
#: what makes a library's log heard by nobody
_SILENT = frozenset({"logging.NullHandler", "logging.getLogger", "logging.getLogger.addHandler"})
#: what only asks what a stream is
_LOOKING = ("isatty", "fileno", "encoding")
_TERMINALS = ("/dev/stdout", "/dev/stderr", "/dev/fd/1", "/dev/fd/2", "/dev/tty", "CON", "CONOUT$")


def only_view_prints(tree: SourceTree) -> Iterator[str]:
    """Nobody else prints or asks: neither called, nor handed on, nor by another name."""
    for file, module in tree:
        if file in MAY_PRINT:
            continue
        looked_at = {
            id(node.value) for node in nodes(module) if isinstance(node, ast.Attribute) and node.attr in _LOOKING
        }
        for used, names in named(module):
            if id(used) not in looked_at and not names & _SILENT:
                said = names & (_SAYING | _STREAMS) or {name for name in names if name.startswith(_MODULES)}
                yield from (f"{file}:{used.lineno} {name}" for name in sorted(said)[:1])
        yield from (f"{file}:{node.lineno} {ast.unparse(node)}" for node in nodes(module) if _writes(node))


def _writes(node: ast.AST) -> TypeGuard[ast.expr]:
    """Whether *node* writes to a stream that somebody else has, or is a terminal's name."""
    match node:
        case ast.Call(func=ast.Attribute(value=ast.Attribute(attr="stdout" | "stderr"), attr="write" | "writelines")):
            return True
        case ast.Call(func=ast.Name(id="open") | ast.Attribute(attr="fdopen"), args=[ast.Constant(value=int()), *_]):
            return True
        case ast.Constant(value=str(text)):
            return text in _TERMINALS
    return False
