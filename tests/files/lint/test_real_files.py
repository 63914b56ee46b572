"""Files that work: those of the built-in families have no error, those of `--eds-corpus` only what is really wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.files.device_lint import lint
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.network.family_file import family_eds, family_names
from tests.files.lint.sample import EVERY
from tests.real_files import real_files

#: What is wrong in real files, looked at one by one: the rules of the errors that they rightly get.
WRONG = {
    # INTEGER32 with fractions as defaults; RPDO6 counts 4 of 2 entries; enumerations that begin at 1 and default to 0
    "axiomatic_multi-io.eds": {"bad-value", "empty-entry", "default-outside-limits"},
    # 0x1001 of 16 bits, 0x1003:00 of 32, 0x1015 of 32, 0x1200:00 of 16
    "curtis_acf2a-node26.eds": {"standard-type"},
    # RPDOs that receive what is for TPDOs (rwr), of 128 bits, of lengths that the objects do not have
    "oresat_c3.dcf": {"direction", "entry-length", "pdo-length"},
    # TPDO2 on 0x102; values beyond their own limits (65535 where 1000 is the most)
    "sevcon_gen4-borgwarner.dcf": {"can-id-restricted", "default-outside-limits", "value-outside-limits"},
}


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "path" in metafunc.fixturenames:
        paths = real_files(metafunc.config)
        metafunc.parametrize("path", paths, ids=[path.name for path in paths])


def errors(path: Path) -> set[str]:
    found = lint(read_eds(path), path.name, EVERY)
    assert all(finding.line >= 1 and finding.text for finding in found)
    return {finding.rule for finding in found if finding.severity == "error"}


def test_a_real_file_has_the_errors_that_are_its_own(path: Path) -> None:
    assert errors(path) == WRONG.get(path.name, set())


@pytest.mark.parametrize("name", family_names())
def test_the_files_of_families_have_no_error(name: str) -> None:
    assert errors(family_eds(name)) == set()
