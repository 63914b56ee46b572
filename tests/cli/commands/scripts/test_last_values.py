"""`pdo PDO` in a script: what the last frame held that this session saw since the PDO was set so."""

from __future__ import annotations

import json
from typing import Any

from tests.cli.commands.bench import Bench
from tests.process import dvtcli

MAP = ("map tpdo1 5100:1 6041 --sync 1", "nmt start")


def lasts(*lines: str) -> list[dict[str, Any] | None]:
    """The element `last_frame` of each `pdo` of a script, which runs in a process of its own."""
    done = dvtcli("--sim", "gen4", "--json", "-y", stdin="\n".join(lines) + "\n")
    assert done.returncode == 0, done.stderr
    documents = [json.loads(line) for line in done.stdout.splitlines()]
    return [one["pdos"][0]["last_frame"] for one in documents if one["schema"] == "dvtcli.pdo/1"]


def test_it_is_what_came_after_sync() -> None:
    before, last = lasts(*MAP, "pdo tpdo1", "sync --period 10 --count 3", "pdo tpdo1")
    assert before is None
    assert last is not None
    assert last["data"] == "00 03 50 02"
    assert [one["physical"]["text"] for one in last["values"]] == ["48.0 V", "switch on disabled"]
    assert len(last["period_ms"]) == 3


def test_the_screen_has_its_column() -> None:
    done = dvtcli("--sim", "gen4", stdin="\n".join([*MAP, "sync --count 2", "pdo tpdo1"]) + "\n")
    assert "LAST VALUE" in done.stdout
    assert "48.0 V (768)" in done.stdout
    assert "  last frame  00 03 50 02     " in done.stdout


def test_a_frame_of_another_mapping_is_none_of_this_one() -> None:
    """The old bytes mean something else by the new mapping, and a restart may bring back another one."""
    sent = ("sync --count 2", "pdo tpdo1")
    lines = (
        *MAP,
        *sent,
        "map tpdo1 6041 5100:1 --sync 1",
        "pdo tpdo1",
        "nmt start",
        *sent,
        "nmt reset-node",
        "pdo tpdo1",
    )
    first, mapped, second, reset = lasts(*lines)
    assert (first or {}).get("data") == "00 03 50 02"
    assert mapped is None
    assert (second or {}).get("data") == "50 02 00 03"
    assert reset is None


def test_a_single_command_has_heard_nothing() -> None:
    with Bench(("gen4",)) as bench:
        assert bench.run("pdo tpdo1 --json").document["pdos"][0]["last_frame"] is None
