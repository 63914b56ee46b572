"""The automatic backup is of what a node held before a whole, also where that is taken back on the way."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.errors import DeviceRefused
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.operations.network.bench import Chain

PART = "  tpdo: {2: {mapping: [6041, 606C]}, 1: {event_timer: 70}}\n"


@heavy
def test_what_is_taken_back_is_no_state_to_go_back_to(home: Path) -> None:
    folder, path = home.parent / "files", home.parent / "net.yaml"
    folder.mkdir()
    path.write_text("".join(f"n{node_id}:\n  node_id: {node_id}\n{PART}" for node_id in (5, 9)))
    families = {5: "generic", 9: "generic"}
    chain = Chain(folder, ["9:refuse@3=0x08000000"], families=families, operational=False)
    before = chain.held()
    with pytest.raises(DeviceRefused) as refused:
        chain.apply(path)
    assert (refused.value.state, chain.held() == before) == ("rolled_back", True)
    assert [one.name.split("-")[1] for one in sorted((folder / "backups").glob("*.dvt"))] == ["5", "9"]
    for node_id in families:
        chain.bus._closed = False
        with Bench((), {"sim": (), "yes": True, "journal": str(folder), "node": node_id}, chain.bus) as bench:
            assert bench.run("undo --backup").code == 0
    assert chain.held() == before
