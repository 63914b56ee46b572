"""`alias` keeps the user's own words in the user's settings, and the prompt knows them at once."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from dvtcli.files.user_folders import user_folder
from tests.cli.commands.bench import Bench
from tests.cli.prompt.terminal import Terminal


def file() -> Path:
    return user_folder("config") / "config.toml"


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("XDG_CONFIG_HOME", "LOCALAPPDATA", "HOME"):
        monkeypatch.setenv(name, str(tmp_path))


@pytest.mark.parametrize(
    "written", ["alias v = read 6041", "alias v= read 6041", "alias v =read 6041", 'alias v = "read 6041"']
)
def test_an_alias_is_kept_beside_other_settings(written: str) -> None:
    file().parent.mkdir(parents=True, exist_ok=True)
    file().write_text('timeout = "2"  # slow\n\n[aliases]\nold = "pdo"\n')
    with Bench() as bench:
        assert bench.run(written).code == 0
    assert tomllib.loads(file().read_text()) == {"timeout": "2", "aliases": {"old": "pdo", "v": "read 6041"}}
    assert "# slow" in file().read_text()


def test_options_behind_the_name_are_the_lines_own() -> None:
    with Bench() as bench:
        document = bench.run("alias --json fast = map tpdo1 6041 --sync 1 --json").document
    assert document["aliases"] == [{"name": "fast", "line": "map tpdo1 6041 --sync 1 --json", "file": str(file())}]
    assert document["changed"]
    assert tomllib.loads(file().read_text())["aliases"] == {"fast": "map tpdo1 6041 --sync 1 --json"}


def test_an_alias_is_removed_and_a_dry_run_keeps_it() -> None:
    with Bench() as bench:
        assert bench.run("alias v = pdo").code == 0
        assert bench.run("alias --dry-run v =").code == 0
        assert tomllib.loads(file().read_text())["aliases"] == {"v": "pdo"}
        assert bench.run("alias v =").code == 0
        assert "aliases" not in tomllib.loads(file().read_text())
        assert bench.run("alias v =").code == 2


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("alias read = pdo", "is a command already"),
        ("alias v", "alias NAME = LINE"),
        ("alias v read", "alias NAME = LINE"),
        ("alias v/w = pdo", "is not one word"),
        ("alias v = write 5000:2 17476", "passcode"),
    ],
)
def test_what_would_be_no_alias_is_refused_and_nothing_is_kept(written: str, said: str) -> None:
    with Bench(("gen4-locked",)) as bench:
        bench.session.node()
        ran = bench.run(written)
    assert ran.code == 2
    assert said in ran.stderr
    assert not file().exists()


def test_the_prompt_knows_a_new_alias_at_once(gen4: Terminal) -> None:
    gen4.run("alias vendor = read 1018:1")
    gen4.wait("vendor = read 1018:1 (in")
    gen4.wait_prompt()
    gen4.run("vendor")
    gen4.wait("0x0000001E")
    gen4.wait_prompt()
    gen4.run("alias")
    gen4.until(lambda: "vendor = read 1018:1" in [line.strip() for line in gen4.lines], "the list of aliases")
    gen4.wait_prompt()
    gen4.run("alias vendor =")
    gen4.wait("vendor is no longer an alias")
    gen4.wait_prompt()
    gen4.run("vendor")
    gen4.wait("unknown command 'vendor'")
