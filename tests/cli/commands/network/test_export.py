"""`export`: the file says what the node holds, so that carrying it out writes nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.network.network_config import NodeConfig, PartialPdoConfig
from dvtcli.domain.request import PdoRequest
from dvtcli.files.network.read_network import read_network_file
from dvtcli.operations.values.named_objects import entry_at
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device
from tests.harness.sample import heavy


def exported(bench: Bench, file: Path) -> NodeConfig:
    ran = bench.run(f"export {file}")
    assert ran.code == 0, ran
    (node,) = read_network_file(file).nodes
    return node


def request(bench: Bench, config: PartialPdoConfig) -> PdoRequest:
    """What `map` and `set` would be asked for *config*."""
    node = bench.session.node()
    return PdoRequest(
        config.cob_id, config.transmission_type, config.inhibit_time, config.event_timer, config.sync_start_value,
        config.rtr_allowed, config.extended, config.enabled,
        tuple(entry_at(node, word.text) for word in config.mapping or ()),
    )  # fmt: skip


@pytest.mark.parametrize("family", ["gen4", "tmcm", "roboteq", "espac", "canopennode", "generic"])
def test_carrying_out_what_was_exported_writes_nothing(family: str, tmp_path: Path) -> None:
    with Bench((f"{family}@5",)) as bench:
        config = exported(bench, tmp_path / "node.yaml")
        node = bench.session.node()
        held = node.pdos()
        assert {one.pdo for one in config.pdos} == held.keys()
        applied = node.configure({one.pdo: request(bench, one) for one in config.pdos}, force=True)
        assert [step for step in applied.plan.steps] == []  # noqa: C416


def test_what_was_changed_is_exported_and_carried_out_elsewhere(tmp_path: Path) -> None:
    with Bench(("gen4",)) as bench:
        assert bench.run("map tpdo1 6C01:1 606C 6041 --cob-id 0x201 --sync 1").code == 0
        assert bench.run("map rpdo2 dummy/8 dummy/8 60FF").code == 0
        config = exported(bench, tmp_path / "node.yaml")
        held = bench.session.node().pdos()
    text = (tmp_path / "node.yaml").read_text("utf-8")
    assert "          - velocity_actual_value               # 606C:00/32\n" in text
    assert "/8                           # skips 8 bits\n" in text
    with Bench(("gen4",)) as other:
        node = other.session.node()
        node.configure({one.pdo: request(other, one) for one in config.pdos if not one.pdo.is_tpdo})
        node.configure({one.pdo: request(other, one) for one in config.pdos if one.pdo.is_tpdo})
        assert node.pdos() == held


def test_a_file_is_overwritten_with_consent_only(tmp_path: Path) -> None:
    file = tmp_path / "node.yaml"
    file.write_text("mine", "utf-8")
    with Bench(("gen4",)) as bench:
        assert bench.run(f"export {file}").code == 6
        assert file.read_text("utf-8") == "mine"
        assert bench.run(f"export {file} --yes").code == 0
        assert bench.run(f"export {tmp_path / 'node.txt'}").code == 2
        assert bench.run(f"export {tmp_path}").code == 2


@heavy
def test_the_answer_says_how_much(tmp_path: Path) -> None:
    with Bench(("gen4",)) as bench:
        document = bench.run(f"export {tmp_path / 'a.yml'} --json").document
    assert (document["schema"], document["node"], document["pdos"], document["left_out"]) == (
        "dvtcli.export/1", 1, 10, [],
    )  # fmt: skip


def test_with_several_nodes_it_says_which_one_it_wrote(tmp_path: Path) -> None:
    with Bench(("gen4@1", "tmcm@5")) as bench:
        ran = bench.run(f"export {tmp_path / 'a.yaml'}")
    assert (
        "This is node 1 only: -n 5 exports another, `dvtcli --sim gen4@1 --sim tmcm@5 import FILE.yaml` all nodes."
        in ran.stdout
    )


def test_where_no_node_is_selected_import_is_named(tmp_path: Path) -> None:
    with Wire(device("generic")) as wire, Bench((), {**wire.options, "node": None}) as bench:
        ran = bench.run(f"export {tmp_path / 'all.yaml'}")
        ran.failed(2, "none is selected")
        assert "import" in ran.stderr
        assert bench.run("node 1").code == bench.run(f"export {tmp_path / 'all.yaml'}").code == 0
