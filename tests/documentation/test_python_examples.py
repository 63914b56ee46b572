"""Every Python example of the documentation runs: sessions as doctests, programs as they stand, tests by pytest."""

from __future__ import annotations

import doctest
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from dvtcli.simulator.network.family_file import family_eds
from dvtcli.testing import dvtcli_serve, dvtcli_state
from tests.documentation.pages import PAGES, text
from tests.harness.sample import heavy
from tests.process import PATIENCE_S, ROOT

__all__ = ["dvtcli_serve", "dvtcli_state"]

_BLOCK = re.compile(r'^```(python|pycon)(?: title="([\w.]+)")?\n(.*?)^```$', re.M | re.S)
#: the bus of the examples, in whose place simulated nodes are served
_BUS = 'interface="socketcan", channel="can0"'

Block = tuple[str, str, str]


def blocks() -> list[tuple[str, Block]]:
    return [(page, block) for page in PAGES for block in _BLOCK.findall(text(page))]


def programs(kind: str, *, titled: bool = False) -> list[object]:
    found = [(page, code) for page, (language, title, code) in blocks() if language == kind and bool(title) == titled]
    return [pytest.param(code, id=f"{Path(page).stem}-{number}") for number, (page, code) in enumerate(found)]


@pytest.mark.drawn(2)
@pytest.mark.parametrize("code", programs("pycon"))
def test_sessions_answer_what_they_show(code: str) -> None:
    test = doctest.DocTestParser().get_doctest(code, {}, "session", None, 0)
    failures: list[str] = []
    doctest.DocTestRunner(verbose=False, optionflags=doctest.REPORT_NDIFF).run(test, out=failures.append)
    assert not failures, "".join(failures)


@pytest.mark.drawn(2)
@pytest.mark.parametrize("code", programs("python"))
def test_programs_run(code: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    (tmp_path / "drive.eds").write_bytes(family_eds("gen4").read_bytes())
    if _BUS in code:
        served = request.getfixturevalue("dvtcli_serve")("gen4@5")
        settings = served.settings | {"timeout_s": PATIENCE_S}
        code = code.replace(_BUS, ", ".join(f"{key}={value!r}" for key, value in settings.items()))
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    run([sys.executable, "-c", code], tmp_path)


#: `dvtcli_nodes` as a text, which is one node and not its letters
_ONE_NODE = """
import pytest

@pytest.fixture
def dvtcli_nodes():
    return "gen4@5"

def test_it_is_the_node(dvtcli_node):
    assert dvtcli_node.node_id == 5
"""


@heavy
@pytest.mark.long
def test_tests_pass_with_the_fixtures(tmp_path: Path) -> None:
    files = [(title, code) for _, (_, title, code) in blocks() if title]
    assert {title for title, _ in files} >= {"conftest.py"}
    for title, code in files:
        (tmp_path / title).write_text(code, encoding="utf-8")
    (tmp_path / "test_one_node.py").write_text(_ONE_NODE, encoding="utf-8")
    said = run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "."], tmp_path)
    assert re.search(r"\b[3-9] passed", said), said


def run(words: list[str], folder: Path) -> str:
    environment = os.environ | {"PYTHONPATH": str(ROOT), "XDG_STATE_HOME": str(folder / "state")}
    environment.pop("PYTEST_ADDOPTS", None)
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
