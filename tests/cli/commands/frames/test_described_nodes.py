"""Objects are named by the network file or by --eds, whatever else these say."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench

GEN4 = str(family_eds("gen4"))
#: an object that only the drive's file names, asked of nodes 5 and 6; an EMCY, a PDO
FRAMES = ("605#4020200000000000", "606#4020200000000000", "085#2030810000000000", "185#3706")
NAME = "Motor drive left"
#: no plan is made for it: the object is part of TPDO1
REFUSED = """nodes:
  drive:
    node_id: 5
    profile: gen4
    tpdo:
      1: {mapping: ["6041:00"]}
    sdo:
      - {index: 0x1A00, sub_index: 1, value: 0x60410010}
"""


@pytest.fixture(autouse=True)
def _ground(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("raw.yaml").write_text(REFUSED, "utf-8")
    lines = (f"({number}.000000) can0 {frame}\n" for number, frame in enumerate(FRAMES))
    Path("run.log").write_text("".join(lines), "ascii")


@pytest.mark.parametrize(
    "line", ["decode run.log -d raw.yaml", f"explain {FRAMES[0]} -d raw.yaml", "decode run.log -d raw.yaml --json"]
)
def test_a_file_without_a_plan_names_objects(line: str) -> None:
    bench = Bench(())
    assert "1A00" in bench.run("check raw.yaml").stdout
    ran = bench.run(line)
    assert (ran.code, ran.stderr, NAME in ran.stdout) == (0, "", True), ran


@pytest.mark.parametrize("frame", FRAMES)
def test_each_kind_of_frame_is_explained_without_a_plan(frame: str) -> None:
    ran = Bench(()).run(f"explain {frame} -d raw.yaml")
    assert (ran.code, ran.stderr) == (0, ""), ran


def test_values_are_all_written_without_a_plan() -> None:
    ran = Bench(()).run("decode run.log -d raw.yaml -o v.csv")
    assert ran.code == 0, ran.stderr
    assert not list(Path().glob("*until-damage*"))
    assert "0x0637" in Path("v.csv").read_text("utf-8") or "1591" in Path("v.csv").read_text("utf-8")


@pytest.mark.parametrize(
    "line",
    [
        "log v.csv --decode --duration 0.3 -d raw.yaml",
        *(f"monitor --duration 0.3 {option} raw.yaml" for option in ("-d", "--dbc", "--decode")),
    ],
)
def test_the_bus_is_read_without_a_plan(line: str) -> None:
    """A node's EMCY ends nothing."""
    with Bench(("gen4@5",), {"fault": ("emcy=0x3210:0.1",)}) as bench:
        ran = bench.run(line)
        assert (ran.code, "1A00" in ran.stderr) == (0, False), ran


@pytest.mark.parametrize("line", ["explain {}", "decode run.log"])
@pytest.mark.parametrize(("nodes", "named"), [(None, (5, 6)), (5, (5,)), ((6,), (6,)), ("all", (5, 6))])
def test_eds_is_of_the_nodes_that_are_named(line: str, nodes: object, named: tuple[int, ...]) -> None:
    """Without -n it is of all."""
    options = {"eds": GEN4} if nodes is None else {"eds": GEN4, "node": nodes}
    for node_id, frame in zip((5, 6), FRAMES, strict=False):
        ran = Bench((), options).run(line.format(frame))
        assert ran.code == 0, ran
        said = (
            ran.stdout if "{}" in line else "".join(one for one in ran.stdout.splitlines() if f"node {node_id} " in one)
        )
        assert (NAME in said) == (node_id in named), ran
