"""Every example in the commands' help is run, with what `help_examples.toml` says it needs."""

from __future__ import annotations

import re
import shutil
import signal
import threading
import tomllib
from contextlib import chdir
from pathlib import Path
from typing import IO, Any

import pytest

from dvtcli.cli.catalogue import command_names
from dvtcli.cli.lexer import split
from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench
from tests.cli.commands.frames.test_recording_commands import DBC
from tests.cli.commands.program.test_every_command import examples
from tests.process import PATIENCE_S, ROOT, dvtcli, environment, start
from tests.small_eds import plain, var
from tests.small_recording import ramp
from tests.surroundings import HOMES

NEEDS: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_name("help_examples.toml").read_text("utf-8"))
EXAMPLES = [line for name in command_names() for line in examples(name)]

#: candump of somebody who reads TPDO1 of node 5: its COB-ID, how many objects it maps, and which one
SETUP = "".join(
    f"({number}.000000) can0 {frame}\n"
    for number, frame in enumerate(("585#4300180185010000", "585#4F001A0001000000", "585#43001A0110004160"))
)


def kind(key: str) -> list[str]:
    """The examples that have *key*."""
    return [line for line in EXAMPLES if key in NEEDS.get(line, {})]


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The same ramp in three formats."""
    folder = tmp_path_factory.mktemp("recordings")
    return [ramp(folder / f"run.{suffix}") for suffix in ("log", "asc", "blf")]


def manager_eds() -> str:
    """A device that may be a manager of five nodes (CiA 302-3)."""
    eds = plain()
    eds.record(0x1F22, "Concise DCF", {sub: var(f"Node {sub}", 0xF) for sub in range(1, 6)})
    return eds.text()


def dcf(eds: str) -> str:
    """*eds* with the defaults of the heartbeat time and of TPDO1's transmission type as values."""
    said, count = re.subn(r"(?ms)(^\[(?:1017|1800sub2)\].*?^)Default(Value=.*?\n)", r"\1Parameter\2Default\2", eds)
    assert count == 2
    return said


@pytest.fixture
def folder(recordings: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that examples name, and the home of whoever runs them."""
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path / "home"))
    (tmp_path / "scripts").symlink_to(ROOT / "scripts")
    for name in ("drive.eds", "bare.eds"):
        shutil.copy(family_eds("gen4"), tmp_path / name)
    (tmp_path / "press.dcf").write_text(dcf(family_eds("gen4").read_text("utf-8")), "utf-8")
    shutil.copy(family_eds("coupler"), tmp_path)
    (tmp_path / "eds-files").mkdir()
    shutil.copy(family_eds("gen4"), tmp_path / "eds-files")
    for name in ("press.yaml", "line.yaml", "bus.yml"):
        shutil.copy(ROOT / "examples" / name, tmp_path / name)
    (tmp_path / "fw.bin").write_bytes(bytes(3000))
    (tmp_path / "fw.hex").write_text(":10010000214601360121470136007EFE09D2190140\n:00000001FF\n", encoding="ascii")
    (tmp_path / "curve.bin").write_bytes(bytes(300))
    (tmp_path / "drive.dbc").write_text(DBC, encoding="utf-8")
    (tmp_path / "setup.dvt").write_text("map tpdo1 6041\nverify\n", encoding="utf-8")
    (tmp_path / "press.dvt").write_text("map tpdo2 606C --sync 1\n", encoding="utf-8")
    (tmp_path / "manager.eds").write_text(manager_eds(), encoding="utf-8")
    (tmp_path / "setup.log").write_text(SETUP, encoding="ascii")
    for recording in recordings:
        shutil.copy(recording, tmp_path)
    return tmp_path


def test_nothing_is_said_of_examples_that_are_gone() -> None:
    assert NEEDS.keys() <= set(EXAMPLES)
    assert len(kind("why_not")) <= 3


def quick_first(lines: list[str]) -> list[Any]:
    """*lines*, of which the first of each command is quick."""
    first = {line.split()[0]: line for line in reversed(lines)}
    return [pytest.param(line, marks=[pytest.mark.quick] * (line in first.values()) + _needed(line)) for line in lines]


def _needed(line: str) -> list[pytest.MarkDecorator]:
    """The mark of an example that needs a package which few have."""
    packages = {"matplotlib": line.endswith(".png"), "pyarrow": ".parquet" in line}
    return [pytest.mark.needs(package) for package, is_needed in packages.items() if is_needed]


ENDING = [line for line in EXAMPLES if line not in kind("until") + kind("why_not")]


def test_each_command_has_an_example_that_is_run() -> None:
    assert {line.split()[0] for line in [*ENDING, *kind("until")]} >= set(command_names()) - {"exit"}


@pytest.mark.drawn(25)
@pytest.mark.parametrize("line", quick_first(ENDING))
def test_an_example_does_what_it_says(line: str, folder: Path) -> None:
    needs = NEEDS.get(line, {})
    if needs.get("starts"):
        done = dvtcli(*line.split(), cwd=folder)
        assert done.returncode == needs.get("code", 0), done.stderr
        return
    with chdir(folder), Bench(tuple(needs.get("sim", ["gen4"])), {"yes": True}) as bench:
        for before in needs.get("before", []):
            assert bench.run(before).code == 0
        ran = bench.run(line)
    assert ran.code == needs.get("code", 0), ran.stderr


@pytest.mark.drawn(6)
@pytest.mark.parametrize("line", quick_first(kind("until")))
def test_an_example_without_an_end_works_until_control_c(line: str, folder: Path) -> None:
    needs = NEEDS[line]
    words = [] if line.startswith("sim ") else [word for sim in needs.get("sim", ["gen4"]) for word in ("--sim", sim)]
    script = folder / "example.dvt"
    script.write_text("\n".join([*needs.get("before", []), line, ""]), encoding="utf-8")
    run = ["run", str(script)] if "before" in needs else split(line)
    process = start(
        ["--yes", *words, *run, *needs.get("also", [])],
        cwd=folder, env=environment() | {"HOME": str(folder / "home")}, merge=True, pipes=True,
    )  # fmt: skip
    impatient = threading.Timer(PATIENCE_S, process.kill)
    impatient.start()
    try:
        with process.stdout, process.stderr:
            said = until(process.stdout, needs["until"])
            process.send_signal(signal.SIGINT)
            said += process.stdout.read().decode()
        process.wait()
    finally:
        impatient.cancel()
        process.kill()
    assert process.returncode == 130, said
    assert "Traceback" not in said


def until(stdout: IO[bytes], text: str) -> str:
    """What comes from *stdout* until *text* is in it."""
    said = ""
    while text not in said:
        row = stdout.readline().decode()
        said += row
        assert row, said
    return said
