"""What is printed after a change, or stores, that a kill cut short runs as printed, and its sentence is true then.

In virtual time; each printed line is run by somebody else who comes after the kill, on devices and files as they were.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from pathlib import Path

import pytest

from dvtcli.domain.hint import Action
from tests.cli.commands.bench import Bench, Ran
from tests.cli.commands.program.hint_promises import INTERRUPTED
from tests.operations.network.bench import Chain
from tests.operations.network.killed import Watched, afterwards
from tests.operations.network.test_network_stores import TYPE, file, types, while_storing

pytestmark = pytest.mark.drawn(2, "hints after a kill")

#: lines that are refused, or say that something waits, until one of the ways was gone
ASKING = ("set 5:tpdo1 --timer 50", "apply {file}", "plan {file}", "recover")
#: the commands that are printed after each kind of end, as each is typed behind the bus
WAYS = {
    "change": {"recover": Action.RECOVER_ALL, "-n 5 recover": Action.RECOVER},
    "stores": {
        "recover": Action.RECOVER_ALL, "-n 5 recover": Action.RECOVER, "recover --finish": Action.FINISH_STORES,
    },
}  # fmt: skip
_PRINTED = re.compile(r"`dvtcli ([^`]+)`")


@pytest.fixture
def chain(home: Path) -> Chain:
    (home.parent / "files").mkdir()
    home.mkdir(exist_ok=True)
    return Chain(home.parent / "files", bus=Watched, families={5: "generic", 9: "generic"}, operational=False)


def bench(chain: Chain, *, yes: bool, node: int | None = None) -> Bench:
    """A dvtcli that comes after."""
    chain.bus._closed = False
    return Bench((), {"yes": yes, "journal": str(chain.folder), "eds": "generic", "node": node}, chain.bus)


def printed(ran: Ran) -> set[str]:
    """The commands that *ran* printed, without `dvtcli`, the options of the bus, and `--yes`."""
    found = set()
    for command in _PRINTED.finditer(ran.stderr + ran.stdout):
        words = shlex.split(command[1])
        first = next(at for at, word in enumerate(words) if word in ("-n", "recover"))
        found.add(shlex.join(word for word in words[first:] if word != "--yes"))
    return found


def killed(chain: Chain, home: Path, kind: str, look: Callable[[Chain], None]) -> None:
    """`apply` of a file that stores on nodes 5 and 9 ends; *look* is whoever comes after."""
    wrong: list[str] = []
    if kind == "change":

        def on_write(count: int) -> None:
            if count == 2:
                wrong.append(afterwards(chain, home, look))

        chain.bus.on_write = on_write  # type: ignore[attr-defined]
    else:
        while_storing(chain, 9, lambda one: wrong.append(afterwards(one, home, look)), ahead=True)
    chain.apply(file(home))
    assert wrong == [""]


@pytest.mark.parametrize(("kind", "way"), [(kind, way) for kind, runners in WAYS.items() for way in runners])
def test_what_is_printed_runs_and_its_sentence_is_true(chain: Chain, home: Path, kind: str, way: str) -> None:
    before, path, promise = chain.held(), home.parent / "net.yaml", INTERRUPTED[WAYS[kind][way]]

    def look(after: Chain) -> None:
        said = set()
        for line in ASKING:
            with bench(after, yes=line != "recover") as asking:
                said |= printed(asking.run(line.format(file=path)))
        assert said == WAYS[kind].keys()
        words = way.split()
        with bench(after, yes=True, node=int(words[1]) if words[0] == "-n" else None) as going:
            ran = going.run(shlex.join(words[words.index("recover") :]))
            assert ran.code == 0, ran
        assert re.search(promise.prints, ran.stdout, re.S), ran
        if promise.is_as_before:
            assert after.held() == before
        else:
            assert types(after) == {5: 1, 9: 1}
            assert {node_id: stored[TYPE] for node_id, stored in after.stored().items()} == {5: b"\1", 9: b"\1"}
        assert after.journals() == []

    killed(chain, home, kind, look)


def test_scan_alone_says_that_a_change_was_interrupted(chain: Chain, home: Path) -> None:
    def look(after: Chain) -> None:
        with bench(after, yes=False) as asking:
            ran = asking.run("scan")
        assert "was interrupted, which changed nodes 5 and 9" in ran.stderr
        assert printed(ran) == {"recover"}

    killed(chain, home, "change", look)


def test_the_hint_of_one_node_names_all_nodes_that_it_rolls_back(chain: Chain, home: Path) -> None:
    def look(after: Chain) -> None:
        with bench(after, yes=True) as asking:
            ran = asking.run("set 5:tpdo1 --timer 50")
        assert "-n 5 recover` rolls back all nodes of that change (5, 9) to the old configuration" in ran.stderr

    killed(chain, home, "change", look)
