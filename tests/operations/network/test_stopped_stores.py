"""A Ctrl-C around the stores of a network: before the first all is taken back, after it each node's end is said."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.hint import Hint
from dvtcli.errors import Interrupted, LeftChanged
from dvtcli.operations.network.network_files import apply_file
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.session_user import NullReporter
from tests.harness.sample import heavy
from tests.operations.network.bench import Chain
from tests.operations.network.killed import Watched
from tests.operations.network.test_network_stores import TYPE, file, stored_type, types, while_storing


@dataclass
class Said(NullReporter):
    """Keeps the warnings."""

    warnings: list[str] = field(default_factory=list)

    def warning(self, text: Hint | str) -> None:
        self.warnings.append(typed(text))


@pytest.fixture
def chain(home: Path) -> Chain:
    (home.parent / "files").mkdir()
    home.mkdir(exist_ok=True)
    return Chain(home.parent / "files", bus=Watched, families={5: "generic", 9: "generic"}, operational=False)


def ctrl_c(session: Session) -> None:
    """What the signal does; the second one tears the work apart."""
    if session.cancellation.asked(130, insists=True):
        raise KeyboardInterrupt


def test_one_while_all_are_looked_at_takes_everything_back(chain: Chain, home: Path) -> None:
    before, writes = chain.held(), 2
    with chain.session() as session:
        read, asked = chain.bus.send_sdo, list[int]()

        def send_sdo(can_id: int, data: bytes) -> None:
            read(can_id, data)
            if chain.bus.writes == writes and can_id == 0x609:  # the last write was taken, and node 9 is read back
                asked.append(can_id)
                if len(asked) == 12:
                    ctrl_c(session)

        vars(chain.bus)["send_sdo"] = send_sdo
        with pytest.raises(Interrupted, match="before any node stored") as stopped:
            apply_file(session, str(file(home)))
    assert len(asked) >= 12, "it came while node 9 was read for the last time"
    assert (stopped.value.exit_code, stopped.value.state) == (130, "rolled_back")
    assert chain.held() == before
    assert stored_type(chain, 5) is None
    assert chain.journals() == []


def test_one_while_the_first_stores_says_that_the_others_do_so_too(chain: Chain, home: Path) -> None:
    said = Said()
    with chain.session() as session:
        session.reporter = said
        while_storing(chain, 5, lambda _chain: ctrl_c(session))
        done = apply_file(session, str(file(home)))
    assert said.warnings == [
        "too late to stop before the stores: node 5 stored already; node 9 will store, too, so that all keep the same "
        "configuration (Ctrl-C again: stop at once)"
    ]
    assert [one.node for one in done.stored] == [5, 9]
    assert {chain.stored()[node_id][TYPE] for node_id in (5, 9)} == {b"\x01"}


@heavy
def test_a_second_one_says_of_each_node_whether_it_stored(chain: Chain, home: Path) -> None:
    with chain.session() as session:

        def twice(_chain: Chain) -> None:
            ctrl_c(session)
            ctrl_c(session)

        while_storing(chain, 5, twice, ahead=True)
        with pytest.raises(LeftChanged) as left:
            apply_file(session, str(file(home)))
    assert left.value.text == "every node has the planned values, and whether node 5 stored it is not known"
    assert left.value.details[:2] == [("not stored", "node 9"), ("unknown", "node 5")]
    assert left.value.details[2] == ("journals", ", ".join(map(str, chain.journals())))
    assert "recover --finish` lets the remaining nodes store" in typed(left.value.hint)
    assert types(chain) == {5: 1, 9: 1}
    assert stored_type(chain, 9) is None
