"""A script that redefines Tcl's own commands harms itself only; files elsewhere are not opened, by whatever word."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import click
import pytest

from dvtcli.cli.catalogue import command_names
from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.commands import read, verify
from dvtcli.cli.dvt.tcl_calls import ON_NODES
from dvtcli.cli.params import FileType
from dvtcli.cli.registry import REGISTRY
from tests.cli.commands.bench import Bench
from tests.cli.dvt.test_tcl import tcl
from tests.process import dvtcli

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("_tkinter") is None, reason="Python has no _tkinter here (Debian: python3-tk)"
)

CORE = [
    "append", "apply", "array", "catch", "concat", "dict", "error", "eval", "expr", "for", "foreach", "if", "incr",
    "info", "interp", "join", "lappend", "lassign", "lindex", "list", "namespace", "proc", "rename", "return", "set",
    "split", "string", "switch", "unknown", "uplevel", "upvar", "while", "::tcl::info::frame", "::tcl::dict::get",
]  # fmt: skip
HELPERS = ["dvt_call", "dvt_word", "dvt_here", "dvt_frame", "dvt_tick", "dvt_refuse", "dvt_source", "dvt_open"]


@pytest.mark.drawn(8)
@pytest.mark.parametrize("name", [*CORE, *HELPERS])
@pytest.mark.parametrize("how", ["proc {name} args {{error bent}}", "catch {{rename {name} {{}}}}"])
def test_a_redefined_command_breaks_nothing_of_ours(name: str, how: str, tmp_path: Path) -> None:
    (tmp_path / "part.tcl").write_text("\n\nsdo_rnx 1 0x5FFE 0\n")
    bend = how.format(name=name)
    with Bench() as bench:
        ran = tcl(bench, tmp_path, f"{bend}\nputs [sdo_rnx 1 0x1018 1]\nsdo_rnx 1 0x5FFF 0\nsource part.tcl\nexit 0\n")
        assert (ran.code, ran.stdout) == (0, "0x0000001E\n"), ran.stderr
        assert f"{tmp_path}/x.tcl:3: sdo_rnx answered Abort 0x06020000" in ran.stderr
        assert "part.tcl:3: sdo_rnx answered Abort 0x06020000" in ran.stderr


def test_all_of_them_at_once_and_the_frames_of_a_script_stay_its_own(tmp_path: Path) -> None:
    bends = "\n".join(f"catch {{proc {name} args {{return bent}}}}" for name in CORE if name not in ("proc", "catch"))
    with Bench() as bench:
        ran = tcl(bench, tmp_path, "proc f {} {puts [lindex [info frame 0] 3]}\n\nf\nputs [info frame]\n")
        assert (ran.code, ran.stdout) == (0, "1\n1\n"), ran.stderr
        ran = tcl(bench, tmp_path, f"{bends}\nsdo_rnx 1 0x5FFF 0\nexit 3\n")
        assert ran.code == 3, ran.stderr
        assert f"x.tcl:{len(CORE) - 1}: sdo_rnx answered Abort" in ran.stderr


def test_our_commands_may_be_redefined_too(tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(bench, tmp_path, "proc sdo_rnx args {return mine}\nputs [sdo_rnx 1 0x1018 1]\nrename exit {}\n")
        assert (ran.code, ran.stdout) == (0, "mine\n"), ran.stderr


@pytest.mark.parametrize(
    "words",
    [
        "{file}", "tpdo1 {file}", "--frame {file}", "-- {file}", "--timeout 1 {file}", "{file} --format json",
        "--format --timeout {file}", "tpdo1", "/etc/shadow",
    ],
)  # fmt: skip
def test_verify_opens_no_file(words: str, tmp_path: Path) -> None:
    """Also not one without a suffix, nor one that is called like a PDO."""
    folder = tmp_path / "scripts"
    folder.mkdir()
    for path in (tmp_path / "secret", folder / "tpdo1"):
        path.write_text("root:passcode\n")
    (folder / "x.tcl").write_text(f"dvtcli verify {words.format(file=tmp_path / 'secret')}\n")
    done = dvtcli("--sim", "gen4", "run", "x.tcl", cwd=folder)
    assert done.returncode == 2, done.stderr
    assert "passcode" not in done.stderr
    if "--format --timeout" not in words:
        assert "x.tcl:1: dvtcli verify with a file is not available" in done.stderr


@pytest.mark.parametrize(
    "line", ["read 1008 -o {file}", "read -o{file} 1008", "read 1008 --output={file}", "write 2002 @{file}"]
)
def test_an_object_is_neither_read_into_a_file_nor_written_from_one(line: str, tmp_path: Path) -> None:
    own, other = tmp_path / "scripts", tmp_path / "secret"
    own.mkdir()
    other.write_text("root:passcode\n")
    (own / "x.tcl").write_text(f"dvtcli {line.format(file=other)}\n")
    done = dvtcli("--sim", "generic", "--yes", "run", "x.tcl", cwd=own)
    assert done.returncode == 2, done.stderr
    assert f"x.tcl:1: dvtcli {line.split(maxsplit=1)[0]} with a file is not available" in done.stderr
    assert other.read_text() == "root:passcode\n"


def test_a_value_may_begin_with_at(tmp_path: Path) -> None:
    with Bench(("generic",), {"yes": True}) as bench:
        ran = tcl(bench, tmp_path, "dvtcli write 2002 @@secret\nputs [dvtcli read 2002]\n")
        assert (ran.code, "@secret" in ran.stdout) == (0, True), ran.stderr


def test_verify_of_pdos_works_as_ever(tmp_path: Path) -> None:
    with Bench() as bench:
        ran = tcl(bench, tmp_path, "dvtcli map tpdo1 606C\ndvtcli verify tpdo1\ndvtcli verify TPDO1 --timeout 1\n")
        assert ran.code == 0, ran.stderr
        assert "equal" in ran.stdout


def test_a_script_may_link_nodes_and_unlink_them(tmp_path: Path) -> None:
    with Bench(("gen4@1", "generic@6"), {"yes": True}) as bench:
        lines = "dvtcli map 6:rpdo1 6040 --off", "dvtcli link 1:tpdo1 6:rpdo1", "dvtcli unlink 1:tpdo1 6:rpdo1"
        ran = tcl(bench, tmp_path, "\n".join([*lines, "dvtcli apply net.yaml", ""]))
        assert (ran.code, "1 node set: " in ran.stdout) == (2, True)
        assert "x.tcl:4: dvtcli apply is not available" in ran.stderr


def test_every_command_that_works_on_nodes_is_there_but_what_needs_a_person() -> None:
    """A new one is put into `ON_NODES`, or here.

    `recover` is for who looks at the device, `learn` and `lss` ask, `edit` is a screen; `apply`, `clone`, `download`,
    `replay` and `send` take a file.
    """
    commands = {name: REGISTRY.get_command(click.Context(REGISTRY), name) for name in command_names()}
    working = {
        name
        for name, command in commands.items()
        if isinstance(command, DvtCommand) and command.effect not in (Effect.NONE, Effect.RUNS)
    }
    others = {"apply", "clone", "download", "edit", "learn", "lss", "recover", "replay", "send"}
    assert working - set(ON_NODES) == others


def test_no_other_command_of_a_script_takes_a_file() -> None:
    for name in ON_NODES:
        command = REGISTRY.get_command(None, name)  # type: ignore[arg-type]
        assert command is not None
        own = [param for param in command.params if not getattr(param, "hidden", False)]
        files = [param.name for param in own if isinstance(param.type, FileType) or param.metavar == "FILE"]
        assert not files or command in (read.command, verify.command), f"{name} {files}"
