"""Two faults in one `apply` of three nodes, the second one maybe on the way back: as it was, or said which is not."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

import pytest

from dvtcli.errors import DvtcliError, LeftChanged
from tests.network.bench import CHAIN, Chain
from tests.network.test_network_faults import FAULTS, ideal
from tests.sample import turn


def drawn(lot: random.Random) -> list[str]:
    """A fault at a write of the plan, and one at any write of the plan or of the way back."""
    most = ideal()[0]
    planned = [(node_id, step) for node_id in CHAIN for step in range(1, most[node_id] + 1)]
    either = [(node_id, step) for node_id in CHAIN for step in range(1, 2 * most[node_id] + 3)]
    first = lot.choice(planned)
    second = lot.choice([one for one in either if one != first])
    return [f"{node_id}:{lot.choice(FAULTS).format(step)}" for node_id, step in (first, second)]


@pytest.mark.counted
def test_two_faults_leave_no_node_changed_that_is_not_named(home: Path, pytestconfig: pytest.Config) -> None:
    """As many pairs as `--kills` says."""
    lot = random.Random(f"{turn(pytestconfig)} two faults")
    for number in range(pytestconfig.getoption("--kills")):
        faults = drawn(lot)
        folder = home.parent / f"two-{number}"
        folder.mkdir()
        chain = Chain(folder, faults)
        before, stored = chain.held(), chain.stored()
        with pytest.raises(DvtcliError) as raised:
            chain.apply()
        held, waiting = chain.held(), {int(path.stem.rpartition("-")[2]) for path in chain.journals()}
        changed = {node_id for node_id in CHAIN if held[node_id] != before[node_id]}
        assert changed <= waiting, (faults, raised.value, raised.value.details)
        assert bool(waiting) == isinstance(raised.value, LeftChanged), (faults, raised.value)
        assert chain.stored() == stored
        layouts = {one for one in chain.bus.layouts if one[2] not in waiting}
        assert layouts <= ideal()[1], faults
        shutil.rmtree(home, ignore_errors=True)  # what is remembered of these nodes
