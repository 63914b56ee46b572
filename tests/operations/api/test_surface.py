"""The public surface is frozen: whoever changes it changes `surface.txt`, the version and the CHANGELOG with it."""

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
from tests.operations.api.surface import FROZEN, REWRITE, surface
from tests.process import ROOT, environment


def test_the_surface_is_what_was_promised() -> None:
    assert surface() == FROZEN.read_text("utf-8"), f"the public surface is another: {REWRITE} shows what of it"


def test_every_answer_of_a_call_is_public() -> None:
    public = {*results.__all__, *dvtcli.__all__}
    answers = set(re.findall(r"-> (.+)$", FROZEN.read_text("utf-8").partition("\nerrors.")[0], re.M))
    named = {name for answer in answers for name in re.findall(r"\b[A-Z]\w+", answer)}
    assert named - public == {"Iterator", "None", "RemoteNode"}


def test_the_fixtures_are_called_as_what_they_call() -> None:
    for protocol, function in ((testing.Simulate, dvtcli.simulate), (testing.Serve, testing.serve)):
        theirs = inspect.signature(inspect.unwrap(function)).parameters
        ours = dict(inspect.signature(protocol.__call__).parameters)
        del ours["self"]
        assert ours == theirs


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


def test_the_import_costs_nothing() -> None:
    code = (
        "import dvtcli, sys; print(*(name for name in sys.modules if name.startswith('dvtcli')), 'can' in sys.modules)"
    )
    said = subprocess.run(
        [sys.executable, "-c", code], env=environment(), capture_output=True, encoding="utf-8", check=True
    ).stdout
    assert sorted(said.split()) == ["False", "dvtcli", "dvtcli.version"]


@pytest.mark.needs("mypy")
@pytest.mark.drawn(0)
def test_programs_are_checked_with_the_types(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(
        "import dvtcli\n"
        "from dvtcli.results import Changed, NetworksChecked, Stored\n"
        "from dvtcli.testing import Serve, Simulate\n"
        "with dvtcli.simulate('generic') as bus:\n"
        "    changed: Changed = bus.node().map('tpdo1', '6041', (0x606C, 0, 32), cob_id=0x201, sync=1)\n"
        "    stored: Stored = bus.node().store(prove='power', within_s=10)\n"
        "    checked: NetworksChecked = bus.check()\n"
        "    bus.node().set('tpdo1', timr_ms=1)  # wrong\n"
        "    bus.nodes()  # wrong\n"
        "dvtcli.conect(interface='x')  # wrong\n"
        "dvtcli.results.Chnged  # wrong\n"
        "def test_it(dvtcli_simulate: Simulate, dvtcli_serve: Serve) -> None:\n"
        "    dvtcli_simulate('gen4', faults=['drop@1']).node().pdos()\n"
        "    dvtcli_simulate('gen4', fault='drop@1')  # wrong\n"
        "    dvtcli_serve('gen4').connect(timeout_s=1).scan()\n"
        "    dvtcli_serve('gen4', stat='x')  # wrong\n"
        "    dvtcli_serve('gen4').connect(timeout=1)  # wrong\n",
        encoding="utf-8",
    )
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--no-incremental", "--follow-imports=silent", str(program)],
        cwd=ROOT, capture_output=True, encoding="utf-8", check=False,
    )  # fmt: skip
    wrong = {int(line.split(":", 2)[1]) for line in done.stdout.splitlines() if ": error:" in line}
    lines = program.read_text("utf-8").splitlines()
    assert wrong == {at for at, line in enumerate(lines, 1) if "# wrong" in line}, done.stdout + done.stderr
