"""A rule that was not judged is neither counted as passed nor taken for a clean result."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dvtcli.domain.network.check.check_bus import CHECKS_OF_BIT_RATE
from tests.process import ROOT, documents, dvtcli

LINE, LOG = ROOT / "examples" / "line.yaml", ROOT / "examples" / "run.log"


@pytest.mark.parametrize(("file", "rule"), [*((LINE, name) for name in sorted(CHECKS_OF_BIT_RATE)), (LOG, "bus-load")])
def test_a_rule_that_needs_the_bit_rate_is_refused_without_it(file: Path, rule: str) -> None:
    done = dvtcli("check", str(file), "--rule", rule)
    assert (done.returncode, f"rule {rule} cannot be judged: the bit rate is unknown" in done.stderr) == (2, True)
    assert "no error" not in done.stdout
    assert "no problem" not in done.stdout
    done = dvtcli("check", str(file), "--rule", rule, "--json", "-b", "500000")
    (document,) = documents(done.stdout)
    assert (done.returncode in (0, 3), document["files"][0]["rules"]) == (True, 1)


@pytest.mark.parametrize("file", [LINE, LOG])
def test_rules_that_cannot_be_judged_are_not_counted(file: Path) -> None:
    counts = [documents(dvtcli("check", str(file), "--json", *words).stdout)[0]["files"][0]["rules"]
              for words in ((), ("-b", "500000"))]  # fmt: skip
    assert counts[1] - counts[0] == (len(CHECKS_OF_BIT_RATE) if file == LINE else 1)


@pytest.mark.parametrize("name", ["none.yaml", "odd.yaml", "none.log"])
def test_of_a_file_that_cannot_be_read_no_other_rule_passed(name: str, tmp_path: Path) -> None:
    (tmp_path / "odd.yaml").write_bytes(b"a: \xff\xfe")
    done = dvtcli("check", name, "--format", "junit", cwd=tmp_path)
    assert done.returncode in (2, 4)
    assert re.search(r'<testsuites tests="1" failures="1"', done.stdout), done.stdout


@pytest.mark.parametrize("rule", ["too-late", "bus-overload"])
def test_on_a_bus_of_an_unknown_bit_rate_such_a_rule_is_refused_too(rule: str) -> None:
    done = dvtcli("--sim", "gen4", "check", "--rule", rule)
    assert (done.returncode, f"rule {rule} cannot be judged: the bit rate is unknown" in done.stderr) == (2, True)
    assert not done.stdout
    done = dvtcli("--sim", "gen4", "-b", "500000", "check", "--rule", rule)
    assert (done.returncode, "no error" in done.stdout) == (0, True), done.stderr


def test_a_file_is_not_called_compared_with_a_bus_by_rules_that_compare_nothing() -> None:
    words = ("--sim", "gen4@1", "--sim", "generic@5", "-b", "500000", "check", str(LINE), "--live", "--rule")
    assert "against sim" not in dvtcli(*words, "too-late").stdout
    assert "against sim" in dvtcli(*words, "identity").stdout
