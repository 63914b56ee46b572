"""`-n 1,3,5` and `-n all`: what is read, and stored, of one node is so of each of several."""

from __future__ import annotations

import pytest

from dvtcli.domain.ports import Frame
from dvtcli.errors import UsageError
from dvtcli.operations.session.simulated_nodes import simulated_device, simulated_nodes
from dvtcli.operations.user.options import checked
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.cli.commands.bench import Bench
from tests.virtual_time import VirtualTimeBus

NODES = ("gen4@1", "generic@5", "tmcm@7")


@pytest.mark.parametrize(("named", "met"), [((1, 7), [1, 7]), ("all", [1, 5, 7])])
def test_what_is_read_is_read_of_each(named: object, met: list[int]) -> None:
    with Bench(NODES, {"node": named}) as bench:
        for line in ("read 1017", "pdo", "pdo tpdo1", "faults", "store"):
            ran = bench.run(f"{line} --json")
            assert (ran.code, [one["node"] for one in ran.documents]) == (0, met), line
        assert [one["nodes"][0]["node"] for one in bench.run("node --json").documents] == met
        heads = [line for line in bench.run("read 1017").stdout.splitlines() if line.startswith("node ")]
        assert heads == [f"node {one}" for one in met]


def test_a_node_that_is_named_in_the_line_or_selected_is_the_only_one() -> None:
    with Bench(NODES, {"node": (1, 7)}) as bench:
        assert [one["node"] for one in bench.run("read 5:1017 --json").documents] == [5]
        assert [one["node"] for one in bench.run("pdo 5:tpdo1 --json").documents] == [5]
        assert bench.run("node 5").code == 0
        assert [one["node"] for one in bench.run("read 1017 --json").documents] == [5]


def test_a_silent_node_keeps_no_other_from_being_read() -> None:
    bus = VirtualTimeBus([simulated_device(one) for one in simulated_nodes(NODES)], simulated=False)
    with Bench((), {"sim": (), "node": (1, 6, 7)}, bus) as bench:
        ran = bench.run("read 1017 --json")
        assert (ran.code, [one.get("value") for one in ran.documents]) == (5, [500, None, 500])
        ran = bench.run("store --json")
        assert (ran.code, [one["node"] for one in ran.documents]) == (5, [6]), "it is found before the first one stores"


class Refusing(StrictDevice):
    """A device that refuses to store."""

    asked = 0

    def download(self, index: int, sub_index: int, data: bytes) -> None:
        if index == 0x1010:
            self.asked += 1
            raise Refusal(0x0609_0030)
        super().download(index, sub_index, data)


@pytest.mark.parametrize("prove", [False, True])
@pytest.mark.parametrize("ids", [(1,), (5,), (7,), (1, 7), (1, 5, 7)])
def test_a_node_that_refuses_keeps_no_other_from_being_asked_to_store(ids: tuple[int, ...], *, prove: bool) -> None:
    devices = {one: simulated_device(simulated_nodes((f"generic@{one}",))[0]) for one in (1, 5, 7)}
    for node_id in ids:
        devices[node_id].__class__ = Refusing
    others = [one for one in devices if one not in ids]
    with Bench(
        (), {"sim": (), "node": (1, 5, 7), "yes": True}, VirtualTimeBus(list(devices.values()), simulated=False)
    ) as bench:
        ran = bench.run(f"store{' --prove' if prove else ''} --json")
        documents = ran.documents if others else [*ran.documents, {}]
        assert [one["node"] for one in documents[:-1]] == [1, 5, 7]
        assert [one["schema"] != "dvtcli.error/1" for one in documents[:-1]] == [one in others for one in devices]
    assert all(getattr(devices[one], "asked", 0) for one in ids)
    assert ran.code == (7 if others else 1)
    if others:
        assert documents[-1]["stores"] == {"stored": others, "not_stored": [*ids], "unknown": []}
        assert f"-n {','.join(map(str, ids))} store" in documents[-1]["hint"]


def test_lines_that_are_about_one_node_refuse_several() -> None:
    for named in ((1, 7), "all"):
        with Bench(NODES, {"node": named}) as bench:
            for line in ("map tpdo1 6041", "write 1017 500"):
                ran = bench.run(line)
                assert (ran.code, "several nodes are selected, but the command is for one node" in ran.stderr) == (
                    2,
                    True,
                ), line


@pytest.mark.parametrize("word", ["start", "stop", "reset-node"])
def test_an_nmt_command_to_several_nodes_names_the_line_to_one(word: str) -> None:
    with Bench(NODES, {"node": (1, 7), "yes": True}) as bench:
        ran = bench.run(f"nmt {word}")
        assert (ran.code, ran.stderr.splitlines()[0]) == (
            2, f"error: nmt {word} takes one node or `all`, and -n names several",
        )  # fmt: skip
        assert f"nmt {word} 1` commands node 1, and so for 7" in ran.stderr
        ran = bench.run(f"nmt {word} all")
        ran.failed(2, "means every node on the bus, and -n names 1, 7")
        assert bench.run(f"nmt {word} 1").code == 0


@pytest.mark.parametrize("word", ["start", "stop", "reset-node"])
def test_an_nmt_command_with_every_node_selected_is_one_to_all(word: str) -> None:
    with Bench(NODES, {"node": "all", "yes": True}) as bench:
        ran, same = bench.run(f"nmt {word}"), bench.run(f"nmt {word} all")
        assert (ran.code, ran.stdout) == (0, same.stdout)


def test_an_nmt_command_without_a_node_names_the_line_to_all() -> None:
    bus = VirtualTimeBus([simulated_device(one) for one in simulated_nodes(("generic@5", "tmcm@7"))], simulated=False)
    with Bench((), {"sim": ()}, bus) as bench:
        ran = bench.run("nmt start")
        assert ran.code == 2
        assert "nmt start all` commands all nodes on the bus, `dvtcli nmt start ID` one node" in ran.stderr


def test_all_are_those_that_a_scan_finds() -> None:
    bus = VirtualTimeBus([simulated_device(one) for one in simulated_nodes(("generic@5", "tmcm@7"))], simulated=False)
    with Bench((), {"sim": (), "node": "all"}, bus) as bench:
        assert [one["node"] for one in bench.run("read 1017 --json").documents] == [5, 7]


def test_all_are_looked_for_once_so_that_no_later_line_leaves_one_out() -> None:
    """A node that is silent when a later line comes fails there; who joined, and was heard, is one of them."""
    bus = VirtualTimeBus([simulated_device(one) for one in simulated_nodes(("generic@5", "tmcm@7"))], simulated=False)
    nobody: list[int] = []
    bus.tap(lambda frame, sent: nobody.append(frame.can_id) if sent and frame.can_id == 0x600 + 100 else None)
    with Bench((), {"sim": (), "node": "all"}, bus) as bench:
        assert bench.run("read 1017 --json").code == 0
        asked = len(nobody)
        assert asked > 0
        bus.join([simulated_device(one) for one in simulated_nodes(("generic@9",))])
        bus.nodes_said(Frame(0x709, b"\x7f"), 0.1)
        bus.sleep(1)
        assert [one["node"] for one in bench.run("read 1000 --json").documents] == [5, 7, 9]
        assert len(nobody) == asked
        assert bench.run("scan").code == 0
        assert len(nobody) > asked, "scan searches again"


@pytest.mark.parametrize("line", ["store", "read 1017", "faults"])
def test_where_no_node_is_found_nothing_is_called_done(line: str) -> None:
    with Bench((), {"sim": (), "node": "all"}, VirtualTimeBus([], simulated=False)) as bench:
        ran = bench.run(f"{line} --json")
        assert (ran.code, ran.document["error"]) == (5, "no_answer")


def test_a_script_s_lines_are_done_on_each() -> None:
    with Bench(NODES, {"node": (1, 5)}) as bench:
        documents = bench.script("read 1017 --json", "read 1000 --json").documents
        assert [(one["node"], one["object"]) for one in documents] == [
            (1, "1017:00"), (5, "1017:00"), (1, "1000:00"), (5, "1000:00"),
        ]  # fmt: skip


def test_words_that_are_no_nodes() -> None:
    assert checked("node", "all") == "all"
    for word in ("All", "all,1", "1,", "128"):
        with pytest.raises(UsageError):
            checked("node", word)
