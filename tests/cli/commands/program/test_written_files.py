"""Where a file is written whose name leads somewhere else, or is no file."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench

MADE = ("export x.dbc", "export x.dcf", "report x.html", "backup x.jsonl", "read 1008 -o x.bin", "save x.dvt --all")


@pytest.mark.parametrize("line", MADE)
def test_a_link_stays_and_the_file_that_it_leads_to_is_written(line: str) -> None:
    path = Path(next(word for word in line.split() if word.startswith("x.")))
    target = Path("kept") / "target"
    target.parent.mkdir()
    target.write_bytes(b"old")
    path.symlink_to(target)
    with Bench(("gen4",), {"yes": True}) as bench:
        ran = bench.run(line)
    assert ran.code == 0, ran.stderr
    assert path.is_symlink()
    assert target.read_bytes() not in (b"", b"old")
    assert [one.name for one in target.parent.iterdir()] == ["target"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize("line", MADE)
def test_what_is_no_file_is_written_as_it_comes_and_an_error_is_one(line: str) -> None:
    path = Path(next(word for word in line.split() if word.startswith("x.")))
    path.symlink_to("/dev/full")
    with Bench(("gen4",), {"yes": True}) as bench:
        ran = bench.run(line)
    assert ran.code == 2
    assert "No space left on device" in ran.stderr
    assert path.is_symlink()
