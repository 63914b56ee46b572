"""The public names are frozen: whoever changes one changes this file, the version and the CHANGELOG with it."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import dvtcli
from dvtcli import errors, results, testing
from dvtcli.cli.catalogue import command_names
from tests.house.pages import text
from tests.process import ROOT, environment

PUBLIC = {
    "dvtcli": [
        "Bus", "Lss", "Node", "__version__", "add_eds", "check_eds", "connect", "convert", "eds_library", "errors",
        "profile", "profiles", "report", "results", "simulate",
    ],
    "Bus": [
        "apply", "check", "check_sync", "close", "dry_run", "export", "finish_stores", "import_network",
        "is_dry_run", "link", "load", "lss", "name", "node", "plan", "recover", "replay", "report", "scan", "script",
        "send", "sync",
        "unlink",
    ],
    "Lss": ["assign", "bit_rate", "identify", "node_id", "scan", "select", "store"],
    "Node": [
        "apply", "backup", "canopen", "clear", "clear_faults", "clone", "compare", "disable", "download", "enable",
        "export", "faults", "identity", "learn", "login", "map", "nmt", "node_id", "objects", "pdo", "pdos", "read",
        "record", "recover", "require", "restore", "script", "set", "store", "tie", "undo", "verify", "vpdo", "write",
    ],
    "results": [
        "AddedFile", "Changed", "CobId", "Commanded", "Compared", "Difference", "EntryUnread", "FaultRow", "Faults",
        "FileFinding",
        "FileReport", "FileReports", "FileRule", "Finding", "Frame", "FramesSent", "LearnForecast", "LearntDevice",
        "LibraryAdded", "LibraryListing", "LibraryRow", "LoggedIn",
        "LssAddress", "LssBitRate", "LssChanged", "LssFound", "LssGiven", "LssNode", "MappedName", "Message",
        "NetworkApplied", "NetworkLoad",
        "NetworkPlanned", "NodeListing", "NodeRow", "ObjectDifference", "ObjectListing", "ObjectRow",
        "Pdo", "PdoCommunicationParameter",
        "PdoConfig", "PdoListing", "PdoMappingEntry", "PdoRow", "PinRow", "Plan", "ProfileListing", "ProfileRow",
        "ProfileShown", "ProgramLoaded", "Progress", "Proof", "RecordRead", "Replayed", "Step", "Stored", "SyncCheck",
        "SyncSource", "Synced", "ValueRead", "VpdoListing", "VpdoRow", "WholeCompared",
    ],
    "testing": [
        "ServedBus", "dvtcli_bus", "dvtcli_node", "dvtcli_nodes", "dvtcli_serve", "dvtcli_simulate", "dvtcli_state",
        "serve",
    ],
}  # fmt: skip


def members(kind: type) -> list[str]:
    return sorted(name for name in dir(kind) if not name.startswith("_"))


def test_the_names_are_those_that_were_promised() -> None:
    assert {
        "dvtcli": sorted(dvtcli.__all__),
        "Bus": members(dvtcli.Bus),
        "Lss": members(dvtcli.Lss),
        "Node": members(dvtcli.Node),
        "results": sorted(results.__all__),
        "testing": sorted(testing.__all__),
    } == PUBLIC


def test_every_name_is_there_and_says_what_it_is() -> None:
    for name in dvtcli.__all__:
        assert getattr(dvtcli, name), name
    for module in (dvtcli, results, testing):
        for name in module.__all__:
            assert name == "__version__" or inspect.getdoc(getattr(module, name)), name
    assert dir(dvtcli) == dvtcli.__all__


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse(Path(inspect.getfile(dvtcli)).read_text("utf-8"))
    imported = [alias.asname or alias.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)
                for alias in node.names]  # fmt: skip
    assert set(dvtcli.__all__) <= set(imported)
    assert Path(inspect.getfile(dvtcli)).with_name("py.typed").is_file()


def test_every_error_that_a_call_can_raise_is_public() -> None:
    kinds = [kind for _, kind in inspect.getmembers(errors, inspect.isclass) if issubclass(kind, Exception)]
    assert len(kinds) > 10
    assert all(issubclass(kind, errors.DvtcliError) for kind in kinds)


def test_every_command_has_its_call_or_is_said_to_have_none() -> None:
    section = text("docs/how-to/python.md").partition("## Commands and calls")[2].partition("\n## ")[0]
    said = {word for words in re.findall(r"`([^`]+)`", section) for word in [words.split()[0]]}
    assert set(command_names()) - said == set()


def test_the_import_costs_nothing() -> None:
    code = (
        "import dvtcli, sys; print(*(name for name in sys.modules if name.startswith('dvtcli')), 'can' in sys.modules)"
    )
    said = subprocess.run(
        [sys.executable, "-c", code], env=environment(), capture_output=True, encoding="utf-8", check=True
    ).stdout
    assert sorted(said.split()) == ["False", "dvtcli", "dvtcli.version"]


@pytest.mark.drawn(0)
def test_programs_are_checked_with_the_types(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(
        "import dvtcli\n"
        "from dvtcli.results import Changed, Stored\n"
        "with dvtcli.simulate('generic') as bus:\n"
        "    changed: Changed = bus.node().map('tpdo1', '6041', (0x606C, 0, 32), cob_id=0x201, sync=1)\n"
        "    stored: Stored = bus.node().store(prove='power', within_s=10)\n"
        "    bus.node().set('tpdo1', timr_ms=1)\n"
        "    bus.nodes()\n",
        encoding="utf-8",
    )
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--no-incremental", "--follow-imports=silent", str(program)],
        cwd=ROOT, capture_output=True, encoding="utf-8", check=False,
    )  # fmt: skip
    wrong = [line.split(":", 2)[1] for line in done.stdout.splitlines() if ": error:" in line]
    assert wrong == ["6", "7"], done.stdout + done.stderr
