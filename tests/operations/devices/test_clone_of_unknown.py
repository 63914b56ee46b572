"""A file that does not say which product it is of is cloned where its node-ID is typed, or with --force."""

from __future__ import annotations

from pathlib import Path

import pytest

import dvtcli
from dvtcli.errors import SafetyRefusal
from tests.cli.commands.bench import Bench
from tests.small_eds import plain

HEARTBEAT = (0x1017, 0)


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A backup of a device without vendor and product, whose heartbeat is 700 ms."""
    monkeypatch.chdir(tmp_path)
    Path("bare.eds").write_text(plain().text())
    with Bench(("bare.eds@3",), {"yes": True}) as bench:
        assert [bench.run(line).code for line in ("write 1017 700", "backup kept.dcf")] == [0, 0]
    return Path("kept.dcf")


@pytest.mark.parametrize("yes", ["", " --yes"])
def test_a_yes_is_not_enough(kept: Path, yes: str) -> None:
    with Bench(("bare.eds@4",)) as bench:
        ran = bench.run(f"clone {kept}{yes}")
        assert bench.session.node(4).sdo.upload(*HEARTBEAT) == b"\0\0"
    ran.failed(6, "does not name its product: write it to node 4")
    assert "--force writes it to this node" in " ".join(ran.stderr.split())


def test_force_writes_it(kept: Path) -> None:
    with Bench(("bare.eds@4",), {"yes": True}) as bench:
        ran = bench.run(f"clone {kept} --force")
        assert (ran.code, bench.session.node(4).sdo.upload(*HEARTBEAT)) == (0, (700).to_bytes(2, "little")), ran


def test_a_dry_run_asks_nothing(kept: Path) -> None:
    with Bench(("bare.eds@4",)) as bench:
        assert bench.run(f"clone {kept} --dry-run").code == 0
        assert bench.session.node(4).sdo.upload(*HEARTBEAT) == b"\0\0"


@pytest.mark.parametrize("answer", [True, False])
def test_the_answer_decides(kept: Path, answer: bool) -> None:
    asked: list[str] = []

    def ask(question: str) -> bool:
        asked.append(question)
        return answer

    with dvtcli.simulate("bare.eds@4", ask=ask) as bus:
        node = bus.node(4)
        if answer:
            node.clone(kept)
        else:
            with pytest.raises(SafetyRefusal, match="4 was not typed"):
                node.clone(kept)
        assert node.read("1017").value == (700 if answer else 0)
    assert "write it to node 4 anyway?" in asked[0]
