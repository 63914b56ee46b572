"""SIGKILL in the middle of `apply` of a DCF: `recover` brings the node back, and the file is applied then."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.operations.devices.test_apply_file import made
from tests.operations.network.test_network_killed import is_download, journals
from tests.posix import SIGKILL
from tests.simulator.serve.killing import killable

pytestmark = pytest.mark.long
SETTING = ("map tpdo1 606C 6041", "write 1017 700", "set tpdo2 --timer 90")


@pytest.mark.drawn(1)
@pytest.mark.parametrize("kill_at", [1, 2, 4, 6])
def test_a_killed_apply_is_recovered(tmp_path: Path, kill_at: int) -> None:
    file, folder = made(tmp_path, "generic", "dcf", *SETTING), tmp_path / "nodes"
    folder.mkdir()
    with killable(folder, "generic@1") as nodes:
        for controlword in ("6", "7", "15"):
            assert nodes.dvtcli("-n", "1", "write", "6040", controlword).returncode == 0
        assert nodes.dvtcli("-n", "1", "--yes", "apply", str(file)).returncode == 6, "its power stage is on"
        assert nodes.dvtcli("-n", "1", "write", "6040", "6").returncode == 0
        before = nodes.dvtcli("-n", "1", "pdo", "--all", "--json").stdout
        assert nodes.killed(["--yes", "-n", "1", "apply", str(file)], kill_at, is_download) == -SIGKILL
        assert nodes.dvtcli("-n", "1", "--yes", "apply", str(file)).returncode == 6
        recovered = nodes.dvtcli("recover", "--yes")
        assert recovered.returncode == 0, recovered.stderr
        assert nodes.dvtcli("-n", "1", "pdo", "--all", "--json").stdout == before
        assert journals(nodes) == []
        assert nodes.dvtcli("-n", "1", "--yes", "apply", str(file)).returncode == 0
        assert nodes.dvtcli("-n", "1", "diff", str(file)).returncode == 0
