"""Values of every data type are shown without a word of Python, and `objects --mappable` lists what fits a PDO."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dvtcli.domain.datatypes import DATA_TYPES, DataType
from tests.cli.commands.bench import Bench
from tests.small_eds import plain, var

PYTHON = re.compile(r"\w+\(\w+=|\bb'|\bb\"|\\x|True|False|None")
TYPES = sorted((kind for kind in DATA_TYPES.values() if kind.code <= 0x1B), key=lambda kind: kind.code)


def value_of(kind: DataType) -> str:
    """A DefaultValue of *kind*."""
    return "0102" if kind.bits is None and kind.short in ("os", "domain") else "1"


@pytest.fixture(autouse=True)
def device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An EDS with an object of each data type, which it says may be mapped."""
    monkeypatch.chdir(tmp_path)
    eds = plain()
    for kind in TYPES:
        eds.variable(0x2100 + kind.code, var(f"Of {kind.name}", kind.code, value_of(kind), "rwr", 1))
    Path("types.eds").write_text(eds.text())


def test_no_value_is_shown_in_words_of_python() -> None:
    assert len(TYPES) > 20
    with Bench(("types.eds",)) as bench:
        lines = [bench.run("objects 21").stdout]
        lines += [bench.run(f"read {0x2100 + kind.code:04X}").stdout for kind in TYPES]
    assert all(lines)
    assert [line for line in "".join(lines).splitlines() if PYTHON.search(line)] == []


def test_mappable_are_those_that_fit_a_pdo() -> None:
    with Bench(("types.eds",)) as bench:
        rows = bench.run("objects 21 --mappable tpdo --json").document["objects"]
    fit = [f"{0x2100 + kind.code:04X}:00" for kind in TYPES if kind.bits is not None and kind.bits <= 64]
    assert [row["object"] for row in rows if row["object"].startswith("21")] == fit


def test_a_date_is_typed_as_it_is_shown() -> None:
    with Bench(("types.eds",), {"yes": True}) as bench:
        ran = bench.run('write 210C "2026-11-29 12:00:00.007"')
        assert ran.code == 0, ran
        assert "2026-11-29 12:00:00.007" in bench.run("read 210C").stdout


def test_a_29_bit_can_id_has_eight_digits() -> None:
    with Bench(("types.eds",), {"yes": True}) as bench:
        assert bench.run("set tpdo1 --cob-id 0x1234 --extended").code == 0
        shown = bench.run("pdo").stdout + bench.run("pdo tpdo1").stdout
    assert shown.count("0x00001234") == 2, shown
    assert "0x1234 " not in shown
