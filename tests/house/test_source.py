"""What holds for every file: sizes, and what is never called."""

from __future__ import annotations

import ast
import re

import pytest

from dvtcli.cli.catalogue import command_names
from tests.house.draw import nodes
from tests.house.source import Module, modules

pytestmark = pytest.mark.together

MOST_FUNCTION_LINES = 70
MOST_FILE_LINES = 600

MODULES = modules()


@pytest.mark.together
def test_files_and_functions_are_short() -> None:
    for module in MODULES:
        for node in nodes(module.tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                lines = (node.end_lineno or node.lineno) - node.lineno + 1
                assert lines <= MOST_FUNCTION_LINES, f"{module.name}:{node.lineno} {node.name} has {lines} lines"
        assert module.text.count("\n") <= MOST_FILE_LINES, module.name


@pytest.mark.together
def test_nothing_is_evaluated_or_given_to_a_shell() -> None:
    for module in MODULES:
        for node in nodes(module.tree):
            if not isinstance(node, ast.Call):
                continue
            called = ast.unparse(node.func)
            assert called not in ("eval", "exec", "os.system", "os.popen", "pickle.load", "pickle.loads"), module.name
            shell = next((word.value for word in node.keywords if word.arg == "shell"), None)
            assert shell is None or (isinstance(shell, ast.Constant) and shell.value is False), module.name


#: files that open others than `files/input_file.py` does -> what they open
MAY_OPEN = {
    "files/settings_toml.py": "the user's own settings, to change them",
    "files/family_folder.py": "the package's own data",
    "files/device_library/file_notes.py": "dvtcli's own notes",
    "files/device_library/match.py": "dvtcli's own library, whose files were read when they were added",
    "files/picture/page.py": "the package's own templates",
    "files/picture/svg.py": "the package's own templates",
    "files/profile/standards.py": "the package's own data",
    "files/profile/toml.py": "the package's own data",
    "files/read_back.py": "what was just written, by its own reader",
    "files/sim_state.py": "writes the state of a simulated node",
    "files/recordings/captures.py": "writes a recording",
    "files/values/value_file.py": "writes values",
    "operations/eds_library/add_files.py": "compares with dvtcli's own library",
    "operations/frames/kept_exchange.py": "dvtcli's own last exchange",
    "operations/objects/watch_objects.py": "writes values",
    "operations/session/whole_file.py": "writes a file",
    "operations/user/settings_search.py": "settings, which it refuses if they are no file",
    "operations/user/trusted_settings.py": "what is kept of settings, which nobody else can write",
}


def test_files_of_strangers_have_one_door() -> None:
    """Whoever else opened one could wait for a pipe for ever, or read a device without an end."""
    found = {
        module.name
        for module in MODULES
        for node in nodes(module.tree)
        if isinstance(node, ast.Call)
        and module.room in ("files", "operations")
        and ast.unparse(node.func).rpartition(".")[2] in ("open", "read_bytes", "read_text", "fdopen")
        and ("." in ast.unparse(node.func) or ast.unparse(node.func) == "open")
    }
    assert found - {"files/input_file.py"} == MAY_OPEN.keys()


#: words of a command line in an inner room that are none
_NO_COMMAND = {"domain/script_line.py": "writes lines of scripts"}


def test_inner_rooms_name_no_command_and_no_option() -> None:
    """What to do next is a Hint, which `cli` writes as a line and the API as a call."""
    typed = re.compile(rf"`(?:dvtcli|{'|'.join(map(re.escape, command_names()))})\b[^`]*`|(?<![\w-])--[a-z][a-z-]+")
    found = [
        f"{module.name}:{node.lineno} {node.value}"
        for module in modules()
        if module.room in ("domain", "device", "bus", "files", "simulator") and module.name not in _NO_COMMAND
        for node in _texts(module)
        if typed.search(node.value)
    ]
    assert not found


def _texts(module: Module) -> list[ast.Constant]:
    """The texts of *module* without its docstrings."""
    docstrings = {id(node.value) for node in ast.walk(module.tree) if isinstance(node, ast.Expr)}
    found = (node for node in ast.walk(module.tree) if isinstance(node, ast.Constant) and isinstance(node.value, str))
    return [node for node in found if id(node) not in docstrings]
