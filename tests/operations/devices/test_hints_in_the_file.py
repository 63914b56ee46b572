"""What a refused file about a device is told to change stands in the file: no option of `apply` sets a CAN-ID."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench

#: what is wrong: a PDO's COB-ID -> what is hinted at, and the COB-ID, and that of another PDO, by which it is right
WRONG = {
    ("1800", "0x80"): ("take another CAN-ID at 0x1800:01 in the file", ("1800", "0x193")),
    ("1801", "0x85"): ("take another CAN-ID at 0x1801:01 in the file", ("1801", "0x193")),
    ("1800", "0x701"): (
        "choose a CAN-ID within 0x181..0x57F or 0x680..0x6DF at 0x1800:01 in the file",
        ("1800", "0x193"),
    ),
    ("1801", "0x185"): (
        "bit 31 set at 0x1800:01 in the file, take another CAN-ID at 0x1801:01 in the file",
        ("1800", "0x80000185"),
    ),
}


@pytest.fixture
def own(tmp_path: Path) -> str:
    """A DCF of the node as it comes."""
    with Bench(("generic@5",), {"yes": True}) as bench:
        assert bench.run(f"export {tmp_path}/own.dcf").code == 0
    return (tmp_path / "own.dcf").read_text("latin-1")


def with_cob_id(dcf: str, index: str, value: str) -> str:
    text, count = re.subn(rf"(?ms)(\[{index}sub1\].*?ParameterValue=)[^\r\n]*", rf"\g<1>{value}", dcf, count=1)
    assert count
    return text


@pytest.mark.drawn(4)
@pytest.mark.parametrize("verb", ["apply", "clone", "plan"])
@pytest.mark.parametrize("wrong", WRONG, ids="=".join)
def test_the_hint_is_what_the_file_takes(own: str, wrong: tuple[str, str], verb: str) -> None:
    hint, right = WRONG[wrong]
    path = Path("wanted.dcf")
    path.write_text(with_cob_id(own, *wrong), "latin-1")
    with Bench(("generic@5",), {"yes": True}) as bench:
        refused = bench.run(f"{verb} {path}")
        assert (refused.code, f"  hint    {hint}\n" in refused.stderr) == (1, True), refused
        path.write_text(with_cob_id(path.read_text("latin-1"), *right), "latin-1")
        assert bench.run(f"{verb} {path}").code == 0


@pytest.mark.parametrize("suffix", ["xdc", "jsonl", "json"])
def test_so_it_is_of_each_file_about_a_device(suffix: str) -> None:
    """Also of a saved plan, in which nobody looks for an option either."""
    with Bench(("generic@6",), {"yes": True}) as other:
        assert other.run("set tpdo1 --cob-id 0x85 --force").code == 0
        made = {"jsonl": "backup wanted.jsonl", "json": "export wanted.dcf"}.get(suffix, "export wanted.xdc")
        assert other.run(made).code == 0
    with Bench(("generic@5",), {"yes": True, "node": 5}) as bench:
        if suffix == "json":
            assert bench.run("plan wanted.dcf -o wanted.json --force").code == 0
        ran = bench.run(f"apply wanted.{suffix}")
        ran.failed(1, "take another CAN-ID at 0x1800:01 in the file")
