"""`-n 7,9` with a network file: a link that lacks an end is left alone on both."""

from __future__ import annotations

from pathlib import Path

from dvtcli.domain.plan import PdoChange
from dvtcli.operations.network.network_files import plan_file
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from tests.process import documents, dvtcli

NETWORK = """
a: {node_id: 5, tpdo: {1: {mapping: [6000:01]}}, rpdo: {1: {mapping: [6200:01]}}}
b: {node_id: 9, rpdo: {1: {mapping: [6200:01]}}, tpdo: {1: {mapping: [6000:01]}, 2: {transmission: 7}}}
c: {node_id: 7, rpdo: {1: {mapping: [6200:01]}}, tpdo: {2: {transmission: 7}}}
links:
  - {from: a:tpdo1, to: b:rpdo1}
  - {from: b:tpdo1, to: [c:rpdo1, a:rpdo1]}
"""


def changes(file: Path, *nodes: int) -> list[str]:
    """The PDOs that change, where *nodes* are named."""
    sims = ("generic@5", "generic@7", "generic@9")
    with Session(Options(sim=sims, node=nodes)) as session:
        plan = plan_file(session, str(file)).plan
        made = [(one.node_id, change) for one in plan.nodes for change in one.plan.changes]
        return [f"{node_id}:{change.pdo}" for node_id, change in made if isinstance(change, PdoChange)]


def test_a_link_that_lacks_an_end_is_left_alone_on_the_others(tmp_path: Path) -> None:
    file = tmp_path / "network.yaml"
    file.write_text(NETWORK)
    assert changes(file, 7, 9) == ["7:tpdo2", "9:tpdo2"], "each RPDO receives the layout that its producer has"
    assert {"9:rpdo1", "9:tpdo1", "7:rpdo1"} <= set(changes(file, 5, 7, 9))


def test_one_node_that_the_line_names_is_the_only_one(tmp_path: Path) -> None:
    file = tmp_path / "network.yaml"
    file.write_text("a: {node_id: 5, tpdo: {2: {transmission: 7}}}\nb: {node_id: 9, tpdo: {2: {transmission: 7}}}\n")
    sims = ["--sim", "generic@5", "--sim", "generic@9", "--yes", "--json"]
    (applied,) = documents(dvtcli(*sims, "-n", "9", "apply", str(file)).stdout)
    assert [(node["node"], len(node["pdos"])) for node in applied["nodes"]] == [(9, 1)]
    unknown = dvtcli(*sims, "-n", "7", "apply", str(file))
    assert unknown.returncode == 2
    assert "has no node 7" in documents(unknown.stdout)[0]["text"]
    (both,) = documents(dvtcli(*sims, "-n", "9", stdin=f"apply {file}\n").stdout)
    assert [node["node"] for node in both["nodes"]] == [5, 9], "in a script it is the node that is selected"
