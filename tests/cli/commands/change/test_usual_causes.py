"""A refusal that neither a profile nor a rule explains has the usual cause of its abort code as the hint."""

from __future__ import annotations

import re

import pytest

import dvtcli
from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.abort_causes import USUAL_CAUSES, usual_cause
from dvtcli.domain.hint import as_hint
from dvtcli.errors import DvtcliError
from tests.cli.commands.bench import Bench

LINES = ("write 1017 5", "map tpdo1 606C", "clear tpdo1", "disable tpdo1")


@pytest.mark.drawn(12)
@pytest.mark.parametrize("line", LINES)
@pytest.mark.parametrize("code", USUAL_CAUSES, ids=hex)
def test_every_refusal_says_what_to_do(code: int, line: str) -> None:
    with Bench(("generic",), {"fault": (f"refuse@1=0x{code:08X}",)}) as bench:
        ran = bench.run(line)
        assert ran.code != 0
        (hint,) = (line.removeprefix("  hint    ") for line in ran.stderr.splitlines() if line.startswith("  hint"))
        for command in re.findall("`(.*?)`", hint):
            assert bench.run(command).code == 0, "what a hint names runs as printed, and changes nothing"
    with Bench(("generic",), {"fault": (f"refuse@1=0x{code:08X}",)}) as bench:
        assert bench.run(f"{line} --json").document["hint"]


def test_a_hint_names_the_object_and_the_direction() -> None:
    for place, direction in (("1A00:01", "tpdo"), ("1800:01", "tpdo"), ("1600:01", "rpdo"), ("0x1400:02", "rpdo")):
        assert f"`objects --mappable {direction}` lists" in typed(usual_cause(0x0604_0041, place))
    assert "objects" not in typed(usual_cause(0x0604_0041, "1017:00"))
    assert "`read 6041:00`" in typed(usual_cause(0x0607_0010, "0x6041:00"))
    assert usual_cause(0x0604_0000, "1A00:01") is None, "CiA 301 has no such code"
    assert all(typed(usual_cause(code, None)) == typed(as_hint(cause)) for code, cause in USUAL_CAUSES.items())


def test_a_known_reason_needs_no_usual_cause() -> None:
    with Bench(("generic",)) as bench:
        ran = bench.run("write 1A00:1 0x60400010 --force")
        assert ("\n  why     " in ran.stderr, "usually" in ran.stderr) == (True, False), ran.stderr


def test_a_program_gets_it_too() -> None:
    with dvtcli.simulate("gen4") as bus, pytest.raises(DvtcliError) as failed:
        bus.node(1).read("1018:09")
    assert "usually an array that is shorter" in str(failed.value.hint)
