"""Laws 1 and 6: who may import whom, and what may be imported before it is needed."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator

from tests.house.draw import nodes
from tests.house.laws.origins import origins
from tests.house.laws.source_tree import SourceTree, dotted, imported, parsed, typing_only

#: every library, and where it may be touched; one that stands here for no place belongs into no product code
ONLY_IN: dict[str, tuple[str, ...]] = {
    "can": (
        "bus/",
        "files/recorder.py",
        "files/recording.py",
        "files/recordings/",
    ),
    "canopen": ("bus/",),
    "prompt_toolkit": (
        "cli/prompt/",
        "cli/monitor/full_screen.py",
        "cli/monitor/monitor_keys.py",
        "cli/monitor/watch_keys.py",
    ),
    "click": ("cli/",),
    "pytest": ("testing.py",),
    "cantools": ("files/dbc.py",),
    "jinja2": ("files/picture/",),
    "markupsafe": ("files/picture/",),
    "platformdirs": ("files/user_folders.py",),
    "ruamel": ("files/network/yaml_tree.py", "files/pdo_yaml.py"),
    "wcwidth": ("cli/view/columns.py",),
    "asammdf": ("files/recordings/mdf.py",),
}
#: the standard library's doors out of the process, and its ways past the seams
DOORS: dict[str, tuple[str, ...]] = {
    "socket": ("bus/", "simulator/network/hub.py", "simulator/network/hub_client.py"),
    "subprocess": ("bus/discover.py", "bus/transports.py", "cli/dvt/tcl_process.py", "cli/prompt/redirect.py"),
    "logging": ("bus/python_can_settings.py", "operations/api/told.py"),
    "traceback": ("cli/crash.py",),
    "warnings": ("cli/passcode.py",),
    "signal": (
        "cli/dvt/tcl_process.py",
        "cli/monitor/full_screen.py",
        "cli/prompt/redirect.py",
        "cli/prompt/terminal.py",
        "cli/stop_signals.py",
        "operations/api/ctrl_c.py",
    ),
    "urllib": ("cli/view/reports/sarif_lines.py",),  # its `parse`
    "tkinter": ("cli/dvt/tcl_interp.py",),
    "winreg": ("bus/discover.py",),
    "getpass": ("cli/passcode.py",),
    "termios": ("cli/view/typed_ahead.py",),
    **dict.fromkeys(("asyncio", "http", "socketserver", "ssl", "smtplib", "ftplib", "xmlrpc", "pickle"), ()),
    **dict.fromkeys(("multiprocessing", "ctypes", "pty", "runpy", "pkgutil", "webbrowser", "_thread"), ()),
}
#: what else of the standard library may be imported, anywhere: what stands in neither table may not
PLAIN = frozenset(
    [
        "__future__",
        "abc",
        "base64",
        "binascii",
        "bisect",
        "codecs",
        "collections",
        "concurrent",
        "contextlib",
        "copy",
        "csv",
        "dataclasses",
        "datetime",
        "difflib",
        "enum",
        "errno",
        "fcntl",
        "fractions",
        "functools",
        "gc",
        "glob",
        "hashlib",
        "heapq",
        "importlib",
        "inspect",
        "io",
        "ipaddress",
        "itertools",
        "json",
        "math",
        "msvcrt",
        "os",
        "pathlib",
        "platform",
        "pwd",
        "queue",
        "random",
        "re",
        "reprlib",
        "resource",
        "select",
        "selectors",
        "shlex",
        "shutil",
        "stat",
        "statistics",
        "struct",
        "sys",
        "tempfile",
        "threading",
        "time",
        "tomllib",
        "types",
        "typing",
        "unicodedata",
        "uuid",
        "weakref",
        "xml",
        "zlib",
    ]
)
#: rooms that need nothing but the standard library
_GROUND = ("version.py", "domain/", "device/", "simulator/device/", "errors.py")
#: what decides, and is no vocabulary
_JUDGEMENT = ("domain/rules/", "domain/plan.py")
#: what `--help` must not pay for: every library but click, and what of the standard library is large
_HEAVY = (
    *ONLY_IN.keys() - {"click"}, "matplotlib", "pyarrow", "asammdf", "intelhex", "asyncio", "multiprocessing",
    "subprocess", "xml", "http", "urllib", "email", "ssl", "unittest", "pydoc", "sqlite3", "concurrent",
    "tkinter", "logging",
    "dvtcli.simulator", "dvtcli.cli.prompt", "dvtcli.bus.python_can",
)  # fmt: skip
#: what opens or parses something
_PARSES = ("open", "read_text", "read_bytes", "load", "loads", "parse", "fromstring", "read_dictionary", "load_family")
_DEVICE = "simulator/device/"
#: our modules whose names are libraries in them, as others would take them
_MODULES = ("python_can", "dvtcli")
_LATER = (ast.FunctionDef, ast.AsyncFunctionDef)
#: what imports or runs what a string says
_RUNS = ("exec", "eval")
_BY_NAME = ("import_module", "__import__", "find_spec", "run_module", "resolve_name", "load_module", *_RUNS)
#: who imports what another's string names, with what for
_MAY_NAME = {
    "__init__.py": "its own table of names",
    "files/recording_formats.py": "the files in recordings/",
    "files/extras.py": "an extra that a caller names, below",
    "operations/conversions/convert_file.py": "the files beside it",
    "operations/exports/export_file.py": "the files beside it",
    "operations/results/__init__.py": "the files beside it",
}
_STARTS = (
    "__init__.py",
    "__main__.py",
    "cli/main.py",
    "cli/registry.py",
    "cli/boundary.py",
    "operations/session/session.py",
)


def direction(tree: SourceTree) -> Iterator[str]:
    """Imports run in the order of the rooms, and no files import one another in a circle."""
    house = tree.house
    yield from (f"against the order: {arrow}" for arrow in house.outward())
    yield from (f"in a circle: {file}" for circle in house.circles() for file in circle)


def independence(tree: SourceTree) -> Iterator[str]:
    """The strict device knows the domain's vocabulary, by no way the rules or the plan, and no profile."""
    judging = _reaching_judgement(tree)
    for arrow in tree.house.arrows:
        inside = arrow.target.startswith(_DEVICE)
        vocabulary = arrow.target.startswith("domain/") and arrow.target not in judging
        if arrow.source.startswith(_DEVICE) and not inside and not vocabulary:
            yield str(arrow)
    for file, module in tree:
        for node in nodes(module) if file.startswith(_DEVICE) else ():
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and "profile.toml" in node.value:
                yield f"{file}:{node.lineno} {node.value}"
            elif isinstance(node, ast.ImportFrom) and node.module in ("dvtcli", "dvtcli.domain", "dvtcli.families"):
                yield f"{file}:{node.lineno} {ast.unparse(node)}: a room, and not what is needed of it"


def _reaching_judgement(tree: SourceTree) -> dict[str, str]:
    """The files of the domain from which rules or the plan are reached, each with the next one on the way."""
    found = {file: file for file in tree.house.files if file.startswith(_JUDGEMENT)}
    waiting = list(found)
    while waiting:
        file = waiting.pop()
        for arrow in tree.house.arrows:
            if arrow.target == file and arrow.source not in found and arrow.source.startswith("domain/"):
                found[arrow.source] = file
                waiting.append(arrow.source)
    return found


def libraries(tree: SourceTree) -> Iterator[str]:
    """Libraries and doors stay in their rooms, imported or by name; the ground floors need the standard one only."""
    for file, module in tree:
        for_types = typing_only(module)
        for node in nodes(module):
            names = {name.partition(".")[0] for name in imported(node)} if id(node) not in for_types else set()
            names |= _handed_on(module, node) | {by_name(module, node)} - {""}
            for name in names:
                line = f"{file}:{getattr(node, 'lineno', 0)}"
                if name not in _KNOWN:
                    yield f"{line} imports {name}, which stands in no table"
                elif not file.startswith((ONLY_IN | DOORS).get(name, (file,))):
                    yield f"{line} imports {name}"
                if file.startswith(_GROUND) and name not in {*sys.stdlib_module_names, "dvtcli"}:
                    yield f"{line} imports {name}, on the ground"
        yield from (f"{file}:{line} {what}" for line, what in _unreadable(file, module))


_KNOWN = {*PLAIN, *DOORS, *ONLY_IN, "dvtcli"}


def _handed_on(module: ast.Module, node: ast.AST) -> set[str]:
    """The libraries that one of our modules has imported, and another takes from it."""
    if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("dvtcli"):
        return {alias.name for alias in node.names} & ONLY_IN.keys()
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.attr in ONLY_IN:
        ours = any(name.partition(".")[0] in _MODULES for name in origins(module, node.value))
        return {node.attr} if ours else set()
    return set()


def by_name(module: ast.Module, node: ast.AST) -> str:
    """The library that `import_module("x")`, `__import__("x")` or `sys.modules["x"]` names."""
    named: ast.expr | None = None
    if isinstance(node, ast.Call) and _reads_name(module, node) and dotted(node.func).rpartition(".")[2] not in _RUNS:
        named = next(iter([*node.args, *(word.value for word in node.keywords if word.arg == "name")]), None)
    elif isinstance(node, ast.Call) and "sys.modules.get" in origins(module, node.func):
        named = next(iter(node.args), None)
    elif isinstance(node, ast.Subscript) and "sys.modules" in origins(module, node.value):
        named = node.slice
    if isinstance(named, ast.Constant) and isinstance(named.value, str) and not named.value.startswith("."):
        return named.value.partition(".")[0]
    return ""


def _reads_name(module: ast.Module, node: ast.Call) -> bool:
    return any(name.rpartition(".")[2] in _BY_NAME for name in origins(module, node.func))


def _unreadable(file: str, module: ast.Module) -> Iterator[tuple[int, str]]:
    """Imports by a name that nobody can read: neither a string, nor one that begins with one of our folders."""
    for node in nodes(module):
        if not isinstance(node, ast.Call) or not _reads_name(module, node) or file in _MAY_NAME:
            continue
        called = dotted(node.func)
        if called.rpartition(".")[2] in _RUNS:
            if called in _RUNS:  # Tcl has an `eval`, too
                yield node.lineno, f"runs what a string says: {ast.unparse(node)}"
            continue
        first = node.args[0] if node.args else None
        if isinstance(first, ast.JoinedStr):
            first = first.values[0]
        readable = isinstance(first, ast.Constant) and isinstance(first.value, str) and not first.value.startswith(".")
        if not readable or (first.value.startswith("dvtcli") and len(first.value.split(".")) < 3):
            yield node.lineno, f"imports what cannot be read here: {ast.unparse(node)}"


def nothing_heavy_is_eager(tree: SourceTree) -> Iterator[str]:
    """What the program and its commands import at the top of files, and they at theirs, holds nothing heavy.

    Nor does any file open or parse something while it is imported.
    """
    commands = [file for file in tree.texts if file.startswith("cli/commands/")]
    way = {start: start for start in (*_STARTS, *commands)}
    waiting = [*way]
    while waiting:
        file = waiting.pop()
        for node, name in _eager(parsed(tree.texts[file])):
            if any(name == heavy or name.startswith(f"{heavy}.") for heavy in _HEAVY):
                yield f"{way[file]}:{node.lineno} imports {name} at once"
            target = tree.modules.get(name)
            if file == "__init__.py" and target not in (None, "__init__.py", "version.py"):
                yield f"{file}:{node.lineno} imports {name} at once"
            if target is not None and target not in way:
                way[target] = f"{way[file]} -> {target}"
                waiting.append(target)
    for file, module in tree:
        for node in _at_once(module):
            if isinstance(node, ast.Call) and dotted(node.func).rpartition(".")[2] in (*_PARSES, *_BY_NAME):
                yield f"{file}:{node.lineno} {ast.unparse(node.func)} while it is imported"


def _at_once(node: ast.AST) -> Iterator[ast.AST]:
    """Everything that runs with the module: what stands in functions does not, their defaults and decorators do."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, _LATER):
            yield from (inner for one in [child.args, *child.decorator_list] for inner in ast.walk(one))
        elif isinstance(child, ast.Lambda):
            yield from ast.walk(child.args)
        else:
            yield child
            yield from _at_once(child)


def _eager(module: ast.Module) -> Iterator[tuple[ast.stmt, str]]:
    """Every import that runs with the module: at its top, also within `try`, `with`, `if`, `match` and classes."""
    for_types = typing_only(module)
    for node in _at_once(module):
        if isinstance(node, ast.Import | ast.ImportFrom) and id(node) not in for_types:
            yield from ((node, name) for name in imported(node))
