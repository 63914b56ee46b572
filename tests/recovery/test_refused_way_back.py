"""A device that refuses every write of the way back: the error names the way that is left, and it works."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.simulator.serve.served import served

#: from its third SDO download on the node refuses all, for as long as a roll-back and a `recover` try
REFUSALS = [word for number in range(3, 120) for word in ("--fault", f"refuse@{number}=0x06040041")]


@pytest.mark.long
def test_a_reset_finishes_what_the_device_does_not_let_recover_put_back(tmp_path: Path) -> None:
    with served(tmp_path, "generic@1", *REFUSALS) as nodes:
        before = nodes.dvtcli("-n", "1", "pdo").stdout
        mapped = nodes.dvtcli("-n", "1", "map", "tpdo1", "606C")
        assert mapped.returncode == 7, mapped.stderr
        again = nodes.dvtcli("-n", "1", "recover", "--yes")
        assert again.returncode == 7
        assert "nmt reset-node 1" in again.stderr
        assert nodes.dvtcli("-n", "1", "--yes", "nmt", "reset-node").returncode == 0
        finished = nodes.dvtcli("-n", "1", "recover", "--yes")
        assert finished.returncode == 0, finished.stderr
        shown = nodes.dvtcli("-n", "1", "pdo")
        assert "recover" not in shown.stderr
        assert shown.stdout == before
