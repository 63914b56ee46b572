"""What `import` writes of each real EDS and DCF of a folder given with `--eds-corpus DIR` is taken by what reads it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench
from tests.real_files import real_files
from tests.small_eds import communication, mapping, plain


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "path" in metafunc.fixturenames:
        paths = real_files(metafunc.config)
        metafunc.parametrize("path", paths, ids=[path.name for path in paths])


def is_taken(path: Path, folder: Path) -> None:
    """Import *path* alone into *folder*: `plan` finds the device that it is of, and nothing that it cannot mean."""
    (folder / "files").mkdir()
    shutil.copy(path, folder / "files")
    with Bench(()) as bench:
        imported = bench.run(f"import {folder / 'net.yaml'} {folder / 'files'} --json")
        assert imported.code == 0, imported.stderr
        node_id = imported.document["nodes"][0]["node"]
    with Bench((f"{path}@{node_id}",)) as bench:
        planned = bench.run(f"plan {folder / 'net.yaml'}")
        assert planned.code in (0, 1), planned.stderr  # 1: the device's own rules refuse what its file says
        checked = bench.run(f"check {folder / 'net.yaml'}")
        assert "[identity]" not in checked.stdout
        assert "a length in bits" not in checked.stdout + checked.stderr


def test_what_import_writes_is_taken(path: Path, tmp_path: Path) -> None:
    is_taken(path, tmp_path)


def test_what_import_writes_of_a_device_on_the_bus_plans_empty(path: Path, tmp_path: Path) -> None:
    """Also where nobody set SYNC, emergencies and heartbeats: the file says what is held, and `check` takes it."""
    with Bench((f"{path}@5",)) as bench:
        imported = bench.run(f"import {tmp_path / 'net.yaml'}")
        assert imported.code == 0, imported.stderr
        planned = bench.run(f"plan {tmp_path / 'net.yaml'} --json")
        assert (planned.code, planned.document.get("writes")) == (0, 0), planned
        assert bench.run(f"check {tmp_path / 'net.yaml'} --rule network-file").code == 0


def test_a_pdo_with_an_entry_of_no_bits_is_left_out_and_told(tmp_path: Path) -> None:
    eds = plain()
    eds.record(0x1400, "RPDO1", communication("$NODEID+0x200"))
    eds.record(0x1600, "RPDO1 mapping", mapping(1, ["0x00000000"]))
    (tmp_path / "odd.eds").write_text(eds.text(), encoding="utf-8")
    is_taken(tmp_path / "odd.eds", tmp_path)
    with Bench(()) as bench:
        said = bench.run(f"import {tmp_path / 'again.yaml'} {tmp_path / 'files'}")
        assert "left out: RPDO1 is incomplete" in said.stdout + said.stderr
