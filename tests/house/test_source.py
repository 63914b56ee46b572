"""What no file calls, opens or says."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import pytest

from dvtcli.cli.catalogue import command_names
from tests.house.draw import nodes
from tests.house.source import modules

pytestmark = pytest.mark.together

MODULES = modules()


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
    "files/settings_file.py": "the user's own settings, to change them",
    "files/user_folders.py": "the package's own data",
    "files/device_library.py": "dvtcli's own notes, and its own library of files that were read before",
    "files/picture/page.py": "the package's own templates",
    "files/picture/wiring.py": "the package's own templates",
    "files/profiles.py": "the package's own data",
    "operations/session/whole_file.py": "what was just written, by its own reader; writes a file",
    "files/sim_state.py": "writes the state of a simulated node",
    "files/recordings/wireshark.py": "writes a recording",
    "files/values/value_file.py": "writes values",
    "operations/devices/eds_library.py": "compares with dvtcli's own library",
    "operations/frames/last_exchange.py": "dvtcli's own last exchange",
    "operations/objects/watch_objects.py": "writes values",
    "operations/user/settings.py": "settings, which it refuses if they are no file",
    "operations/user/trusted_settings.py": "what is kept of settings, which nobody else can write",
    "files/values/value_rows.py": "the unfinished file of our own recording, which is locked",
    "operations/frames/recorded.py": "the temporary copy of stdin that it made itself",
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


#: the function that makes text of a CAN-ID (three digits, or eight if it has 29 bits), another program's protocol, and
#: probes of 11 bits
_WRITES_CAN_IDS = ("domain/cob_id.py", "simulator/network/hub_client.py", "domain/learning/")
_THREE_DIGITS = re.compile(r"\{[^{}]*\b(can_id|identifier|cob_id|sync|emcy|time|address)\b[^{}]*:03[xX]\}")


def test_no_other_place_writes_a_can_id_with_three_digits() -> None:
    assert [
        f"{module.name}: {line.strip()}"
        for module in MODULES
        for line in module.text.splitlines()
        if not module.name.startswith(_WRITES_CAN_IDS)
        and _THREE_DIGITS.search(line)
        and "RESTRICTED" not in line
        and "default_can_id" not in line
    ] == []
    assert all(map(_THREE_DIGITS.search, ('f"0x{node.emcy[0]:03X} is"', 'f"0x{frame.can_id:03X}"')))


#: inner rooms that write command lines, with what for
_WRITES_LINES = {
    "domain/script_line.py": "lines of scripts",
    "operations/api/called_hints.py": "what has no call is a command",
    "operations/api/python_bus.py": "the words with which the program joins a served bus",
    "operations/nodes/serve_nodes.py": "the line with which another dvtcli joins",
}
#: a command between marks, or an option: with two dashes, or with one in a sentence
_NAMES = "|".join(map(re.escape, command_names()))
_TYPED = re.compile(
    rf"`(?:dvtcli|{_NAMES})(?![\w:.])[^`]*`|(?<!<)dvtcli (?:{_NAMES})\b"
    r"|(?<![\w-])--[a-z][a-z-]+|(?:^|(?<=[ (/]))-(?:[abcdhinopqsvy]|vv)(?= |[,;:)/]|$)(?<!^-.(?=$))"
)


def test_a_command_holds_words_and_options_only() -> None:
    """Its work is an operation, which other programs can call: it imports no device, bus, rule or file format."""
    rooms = ("device", "bus", "watch", "files", "simulator", "domain.rules", "domain.plan", "domain.script_line")
    for module in MODULES:
        for imported, line, typing_only in module.imports() if module.name.startswith("cli/commands/") else ():
            inner = imported.startswith(tuple(f"dvtcli.{room}" for room in rooms))
            assert typing_only or not inner, f"{module.name}:{line} imports {imported}"


def test_inner_rooms_name_no_command_and_no_option() -> None:
    """What to do next is a Hint, and what was given wrongly a name: `cli` writes options, the API arguments."""
    found = {
        module.name: f"{node.lineno} {node.value}"
        for module in MODULES
        if module.room in ("domain", "device", "bus", "files", "watch", "simulator", "operations", "errors")
        for node in _texts(module.tree)
        if _TYPED.search(node.value)
    }
    assert {name: said for name, said in found.items() if name not in _WRITES_LINES} == {}
    assert found.keys() == _WRITES_LINES.keys(), "who needs no permission has none"


@pytest.mark.parametrize(
    "text", ["`pdo tpdo1`", "dvtcli scan finds it", "--eds FILE", "use -n 5", "-i and -c", "(-b)", "with -vv, too"]
)
def test_what_is_typed_is_noticed(text: str) -> None:
    assert _TYPED.search(text)


@pytest.mark.parametrize("text", ["-c", "ls -l", "0x1A00 -5", "one-way -- as it is", "CAN-ID", "vendor-product"])
def test_what_is_not_typed_is_not(text: str) -> None:
    assert not _TYPED.search(text)


def _texts(tree: ast.AST) -> Iterator[ast.Constant]:
    """The texts below *tree* without docstrings, and without what its rules are about: a rule says who asks it."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node
        elif not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)) and not (
            isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("Rule", "LintRule")
        ):
            yield from _texts(node)
