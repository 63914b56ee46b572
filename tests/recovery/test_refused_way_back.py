"""A device that refuses to go back to its own factory state: the error names the way that is left, and it works."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.process import ROOT
from tests.serve.served import served

FACTORY = ROOT / "dvtcli" / "families" / "generic" / "generic.eds"


def enabled_and_empty(folder: Path) -> Path:
    """A device whose TPDO1 is enabled and empty from the factory, and which refuses to enable an empty PDO."""
    text = FACTORY.read_text("utf-8")
    head, count = text.split("[1A00sub0]", 1)
    path = folder / "empty.eds"
    path.write_text(head + "[1A00sub0]" + count.replace("DefaultValue=0x01", "DefaultValue=0x00", 1), "utf-8")
    return path


@pytest.mark.long
def test_a_reset_finishes_what_the_device_does_not_let_recover_put_back(tmp_path: Path) -> None:
    eds = enabled_and_empty(tmp_path)
    with served(tmp_path, f"{eds}@1", "--fault", "refuse@3=0x06040041") as nodes:
        mapped = nodes.dvtcli("-n", "1", "--eds", str(eds), "map", "tpdo1", "6041")
        assert mapped.returncode == 7, mapped.stderr
        again = nodes.dvtcli("-n", "1", "--eds", str(eds), "recover", "--yes")
        assert again.returncode == 7
        assert "nmt reset-node 1" in again.stderr
        assert nodes.dvtcli("-n", "1", "--yes", "nmt", "reset-node").returncode == 0
        finished = nodes.dvtcli("-n", "1", "--eds", str(eds), "recover", "--yes")
        assert finished.returncode == 0, finished.stderr
        assert "recover" not in nodes.dvtcli("-n", "1", "pdo").stderr
