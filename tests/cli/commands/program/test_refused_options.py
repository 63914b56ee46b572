"""An option that would have no effect is refused by its name, also if it is given with others (exit code 2)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from dvtcli.errors import UsageError
from dvtcli.operations.user.refused_options import refuse_options
from tests.cli.commands.bench import Bench

#: a line without a bus, the refused options, and what they need or exclude
WITHOUT_BUS = [
    ("decode {log} -d {net} --nodes 9", "--nodes", "describes the frames"),
    ("explain 185#1027 -d {net} --nodes 9", "--nodes", "describes the frames"),
    ("plot {log} statusword -d {net} --nodes 9", "--nodes", "describes the frames"),
    ("plot {values} statusword --nodes 9", "--nodes", "decoded values"),
    ("plot {values} statusword -d {net}", "--dbc", "decoded values"),
    ("plot {values} statusword -d {net} --nodes 9", "--nodes and --dbc", "decoded values"),
    ("decode {log} --csv --json", "--json", "not with --csv"),
    ("decode {log} --csv -o {new}.csv", "--output", "not with --csv"),
    ("decode {log} --csv -o {new}.csv --json", "--json and --output", "not with --csv"),
    ("decode {log} --layout wide", "--layout", ".parquet"),
    ("decode {log} --source press", "--source", ".parquet"),
    ("check {net} --for 1s", "--for", "--live"),
    ("check {net} -d {net}", "--dbc", "recordings"),
    ("check {log} --for 2s", "--for", "not for a recording"),
    ("check {log} --live", "--live", "not for a recording"),
    ("check {log} --strict", "--strict", "not for a recording"),
    ("check {log} --all", "--all", "not for a recording"),
    ("check {log} --live --for 1s --all --strict", "--live and --for and --all and --strict", "not for a recording"),
    ("load {net} --for 1s", "--for", "only with a bus"),
    ("report {new}.html {net} --for 1s", "--for", "only with a bus"),
    ("help map --all", "--all", "not with a name"),
    ("help map --man", "--man", "not with a name"),
    ("help --all --man", "--all and --man", "exclude each other"),
    ("run {dvt} --max-seconds 5", "--max-seconds", "Tcl"),
]
#: the same with a simulated node
WITH_BUS = [
    ("log {new}.asc --for 100ms -d {missing}", "--dbc", "only with --decode"),
    ("log {new}.asc --for 100ms --nodes 1", "--nodes", "only with --decode"),
    ("log {new}.asc --for 100ms --layout wide", "--layout", "only with --decode"),
    ("log {new}.asc --for 100ms --source press", "--source", "only with --decode"),
    ("log {new}.asc --for 100ms --rotate 1min", "--rotate", "only with --decode"),
    ("log {new}.asc --for 100ms --only emcy", "--only", "only with --decode"),
    ("log {new}.asc --for 100ms --only emcy --nodes 1", "--only and --nodes", "only with --decode"),
    ("log {new}.csv --decode --for 100ms -s 5000", "--file-size", "recorded frames"),
    ("check {net} --for 1s", "--for", "--live"),
    ("download --forget --program 2", "--program", "--forget"),
    ("download --forget --expect crc32", "--expect", "--forget"),
    ("pdo tpdo1 --all", "--all", "the list"),
    ("pdo edit tpdo1 --all", "--all", "the list"),
    ("login 0 --user 7", "--user", "logs out"),
    ("sync --period 20", "--period", "--count"),
    ("watch tpdo1 --every 100ms", "--every", "for objects"),
]


@pytest.fixture
def names(tmp_path: Path) -> dict[str, Path]:
    log, net, dvt, values = (tmp_path / name for name in ("run.log", "net.yaml", "x.dvt", "speed.csv"))
    log.write_text("(1.0) can0 185#3700\n", "ascii")
    net.write_text("nodes:\n  drive:\n    node_id: 5\n    profile: gen4\n", "utf-8")
    dvt.write_text("node\n", "ascii")
    values.write_text("time,seconds,statusword\n2026-01-01T00:00:00Z,0.0,1\n", "ascii")
    return {
        "log": log, "net": net, "dvt": dvt, "values": values, "new": tmp_path / "new",
        "missing": tmp_path / "missing.dbc",
    }  # fmt: skip


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    with Bench(("gen4",)) as made:
        yield made


def is_refused(bench: Bench, line: str, options: str, words: str, names: dict[str, Path]) -> None:
    before = sorted(names["log"].parent.iterdir())
    ran = bench.run(line.format(**names))
    assert ran.code == 2, (ran.stdout, ran.stderr)
    assert f"{options}: " in ran.stdout + ran.stderr
    assert words in ran.stdout + ran.stderr
    assert sorted(names["log"].parent.iterdir()) == before, "no file is made"


@pytest.mark.parametrize(("line", "options", "words"), WITHOUT_BUS)
def test_an_option_without_effect_is_refused(line: str, options: str, words: str, names: dict[str, Path]) -> None:
    is_refused(Bench(()), line, options, words, names)


@pytest.mark.parametrize(("line", "options", "words"), WITH_BUS)
def test_an_option_without_effect_on_a_bus_is_refused(
    line: str, options: str, words: str, names: dict[str, Path], bench: Bench
) -> None:
    is_refused(bench, line, options, words, names)


@pytest.mark.parametrize("line", ["check {net} --for 0", "load {net} --for 0", "report {new}.html {net} --for 0"])
def test_not_to_listen_needs_no_bus(line: str, names: dict[str, Path]) -> None:
    assert "--for" not in Bench(()).run(line.format(**names)).stderr


def test_options_that_are_not_given_are_not_refused() -> None:
    """0 is given."""
    refuse_options({"for_s": None, "live": False, "only": ()}, "no")
    with pytest.raises(UsageError) as caught:
        refuse_options({"for_s": 0.0, "live": False}, "no")
    assert list(caught.value.given) == ["for_s"]
