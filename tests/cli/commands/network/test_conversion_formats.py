"""Every format that `eds convert` has writes what an EDS or a network file says, and is found by its suffix."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.operations.exchange.convert_file import ConversionFormat, conversion_formats
from tests.cli.commands.bench import Bench
from tests.house.source import PACKAGE

NETWORK = "valve:\n  dcf: gen4\n  node_id: 5\n  heartbeat_producer: 100\n  tpdo:\n    1: {cob_id: 0x185}\n"


@pytest.mark.parametrize("suffix", conversion_formats())
def test_it_writes_what_a_file_says(suffix: str) -> None:
    Path("net.yaml").write_text(NETWORK, "utf-8")
    sources = f"{PACKAGE}/families/gen4/gen4.eds", "net.yaml"
    with Bench() as bench:
        ran = [bench.run(f"eds convert {source} {number}{suffix}") for number, source in enumerate(sources)]
    assert [one.code for one in ran].count(0) == 1, ran
    (made,) = Path().glob(f"?{suffix}")
    assert made.read_bytes()


def test_where_nobody_knows_the_suffix_the_answer_names_some() -> None:
    with Bench() as bench:
        ran = bench.run("eds convert a.eds a.doc")
    assert (ran.code, "unknown format" in ran.stderr, ".xdd" in ran.stderr) == (2, True, True), ran


def test_a_format_lacks_no_suffix() -> None:
    with pytest.raises(TypeError, match=r"Nameless needs a line such as suffixes = \(\"\.xdd\", \"\.xdc\"\)"):

        class Nameless(ConversionFormat):
            """One that nobody finds."""
