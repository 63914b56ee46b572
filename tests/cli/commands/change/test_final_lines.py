"""What of a line no undo reverts, as each command and word says it of its own parameters."""

from __future__ import annotations

import pytest

from dvtcli.cli.command import Final
from dvtcli.cli.lexer import split
from dvtcli.cli.parse_line import parse
from dvtcli.cli.scripts.script_parse import does_other, final, is_changing
from tests.cli.commands.bench import Bench

FINAL = {
    "store": Final("store"),
    "restore": Final("restore", brings_back=True),
    "recover": Final("recover", brings_back=True),
    "nmt start": Final("nmt start"),
    "nmt reset-node": Final("nmt reset-node", brings_back=True),
    "nmt reset-comm all": Final("nmt reset-comm", brings_back=True),
    "write 1010:1 save": Final("write to 0x1010"),
    "write 0x1011:1 load": Final("write to 0x1011", brings_back=True),
    "sdo_wn 1 0x1010 1 1702257011 4": Final("sdo_wn to 0x1010"),
    "sdo_wnx 1 0x1011 1 0x64616F6C 4": Final("sdo_wnx to 0x1011", brings_back=True),
    "fpo 1 op": Final("fpo op"),
}
CHANGING = (
    "map tpdo1 6041", "set tpdo1 --timer 100", "clear all", "write 1017 1000", "undo", "vpdo digital-in 1 none",
    "sdo_wn 1 0x1017 0 1000 2", "clear_all_pdos 1",
)  # fmt: skip
OTHER = ("nmt stop", "nmt preop", "login", "fpo 1 pre", "lg 1 4")
NEITHER = ("pdo", "read 6041", "node 1", "sync", "verify", "save x.dvt", "sdo_rn 1 0x6041 0", "run x.dvt")


@pytest.mark.parametrize("line", [*FINAL, *CHANGING, *OTHER, *NEITHER])
def test_a_line_says_what_it_does(line: str) -> None:
    with Bench() as bench, parse(split(line), bench.session) as ctx:
        assert final(ctx) == FINAL.get(line)
        assert is_changing(ctx) is (line in CHANGING)
        assert does_other(ctx) is (line in OTHER or line in FINAL)


@pytest.mark.parametrize("line", [*FINAL, *CHANGING])
def test_a_line_on_twins_of_its_own_does_nothing_to_a_node(line: str) -> None:
    with Bench() as bench, parse(split(f"{line} --dry-run"), bench.session) as ctx:
        assert final(ctx) is None
        assert not is_changing(ctx)
        assert not does_other(ctx)
