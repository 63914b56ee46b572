"""What a project's dvtcli.toml may do before the user trusts it, and that trust ends with the first changed byte."""

from __future__ import annotations

import os
import re
from importlib.util import find_spec
from pathlib import Path

import pytest
from can.interfaces import BACKENDS

from dvtcli.bus import drivers
from dvtcli.cli.prompt.line import Destination, taken_apart, usable_aliases, withheld_aliases
from dvtcli.files.user_folders import user_folder
from dvtcli.operations.user.change_settings import trust_settings
from dvtcli.operations.user.options import options_of
from dvtcli.operations.user.settings import Settings
from tests.process import documents, environment, run
from tests.simulator.serve.served import ANSWER_S, own_environment, served
from tests.surroundings import homes

RIGHT = "0x4444"


def settings_here(text: str) -> Settings:
    """The settings of a project with this file, in the test's own working folder."""
    Path("dvtcli.toml").write_text(text)
    found = Settings()
    found.read_files()
    assert found.unusable is None
    found.start({})
    return found


def test_the_first_use_says_the_keys_and_how_to_trust_them(tmp_path: Path) -> None:
    def said(*words: str) -> str:
        return run(["--sim", "gen4", *words, "read", "6041"], cwd=tmp_path, env=environment() | homes(tmp_path)).stderr

    file = tmp_path / "dvtcli.toml"
    file.write_text('timeout = 0.4\nchannel = "can0"\n')
    first = said("--json")
    assert f"{file}: first used now, and not trusted; it sets timeout, channel; `dvtcli trust`" in first
    assert said() == "", "it is said once"
    file.write_text("timeout = 0.3\n")
    assert "it sets timeout;" in said(), "another content is another file"
    file.write_text("timeout = 0.2\n")
    run(["trust"], cwd=tmp_path, env=environment() | homes(tmp_path))
    assert said() == "", "a trusted file is no news"


@pytest.mark.parametrize(
    ("word", "text"),
    [
        ("ls", "read 6041"),
        ("quit", "read 6041"),
        ("status", "read 6041"),
        ("MAP", "read 6041"),
        ("tpdo1", "write 6040 15"),
        ("force", "read 6041"),
        ("v", "read 6041 | sh"),
        ("v", "read 6041 > ~/.profile"),
        ("v", "read 6041 >> x"),
        ("v", 'read "6041" "|sh"'),
        ("v", "write 6040 15 --yes"),
        ("v", "write 6040 15 --y"),
        ("v", "--ye write 6040 15"),
        ("v", "write 6040 15 -qy"),
        ("v", 'write 6040 15 --"fo"rce'),
        ("v", "write 6040 15 --f"),
    ],
)
def test_an_alias_that_misleads_needs_a_trusted_file(word: str, text: str) -> None:
    content = f"[aliases]\n{word} = '{text}'\nspeed = \"read 606C\"\n"
    found = settings_here(content)
    if word == "force":  # no word of dvtcli, of a shell, or of another program
        assert word in usable_aliases(found)
        return
    assert usable_aliases(found) == {"speed": "read 606C"}
    withheld = withheld_aliases(found)
    assert withheld is not None
    assert f"{word} in [aliases] does not count" in str(withheld)
    assert ("rename aliases that are the name of a command" in str(withheld)) == (word == "MAP")
    trust_settings()
    trusted = settings_here(content)
    assert withheld_aliases(trusted) is None
    if word != "MAP":
        assert usable_aliases(trusted)[word] == text
    assert withheld_aliases(settings_here(content + "#")) is not None, "trust is of these bytes"


def test_an_untrusted_alias_is_no_other_meaning_of_the_users_own() -> None:
    own = user_folder("config") / "config.toml"
    own.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    own.write_text('[aliases]\nsw = "read 6041"\n')
    content = '[aliases]\nsw = "write 6040 15"\n'
    assert usable_aliases(settings_here(content)) == {"sw": "read 6041"}
    trust_settings()
    assert usable_aliases(settings_here(content)) == {"sw": "write 6040 15"}


@pytest.mark.parametrize(
    ("line", "command", "destination"),
    [
        ('q "a | b"', 'read " "a | b"', None),
        ("q 1 | wc", 'read " 1 ', Destination("|", "wc")),
        ("g 181", "pdo ", Destination("|", "grep 181")),
        ("g 181 | wc", "pdo ", Destination("|", "grep 181 | wc")),
        ("  v  1 > f", "read  1 ", Destination(">", "f")),
        ("x v | wc", "x v ", Destination("|", "wc")),
    ],
)
def test_a_line_is_cut_before_its_alias_is_put_in(line: str, command: str, destination: Destination | None) -> None:
    assert taken_apart(line, {"q": 'read "', "g": "pdo | grep", "v": "read"}) == (command, destination)


@pytest.mark.parametrize("table", ["", "bus.bench."])
@pytest.mark.parametrize(
    ("line", "key"),
    [
        ('journal = "../elsewhere"', "journal"),
        ('journal = "kept/here"', "journal"),
        ('channel = "spy://loop://?file=/nowhere/x"', "channel"),
        ('bus_kwargs = ["url=SOCKET://127.0.0.1:1"]', "bus_kwargs.url"),
        ('interface = "neousys"', "interface"),
        ('bus_kwargs = ["dll=x"]', "bus_kwargs.dll"),
        ('bus_kwargs = ["override_library_name=x"]', "bus_kwargs.override_library_name"),
        ('bus_kwargs = { driver = "/nowhere/libx.so.1" }', "bus_kwargs.driver"),
    ],
)
def test_what_reaches_beyond_a_bus_needs_a_trusted_file(table: str, line: str, key: str) -> None:
    content = (f"[{table[:-1]}]\n" if table else "") + line + "\n"

    def said(found: Settings) -> list[object]:
        layers = [found.project.layer, *found.project.buses.values()] if found.project else []
        return [value for layer in layers for value, _ in layer.values() if value]

    found = settings_here(content)
    assert said(found) == []
    assert f"{table}{key} does not count" in str(found.withheld())
    trust_settings()
    trusted = settings_here(content)
    assert said(trusted)
    assert trusted.withheld() is None


def test_no_driver_takes_a_library_from_the_folder_of_a_project() -> None:
    """Of python-can's drivers as they are installed: whichever names a library by a relative path is not asked for."""
    found = set()
    for interface, (module, _) in BACKENDS.items():
        spec = find_spec(module)
        if spec is not None and spec.origin is not None:
            own = Path(spec.origin)
            files = own.parent.glob("*.py") if own.name == "__init__.py" else [own]
            text = "".join(file.read_text("utf-8") for file in files)
            if re.search(r"""(?:DLL|LoadLibrary)\(\s*["']\.{1,2}[/\\]""", text):
                found.add(interface)
    assert found, "python-can has such a driver no longer"
    assert found <= drivers.NOT_ASKED
    for interface in found:
        read = settings_here(f'interface = "{interface}"\n')
        assert read.project is not None
        assert read.project.withheld == ("interface",)


def test_an_untrusted_bus_keeps_what_only_chooses_it() -> None:
    found = settings_here('channel = "/dev/ttyACM0"\nbus_kwargs = ["dll=x", "receive_own_messages=false"]\n')
    assert found.project is not None
    assert found.project.withheld == ("bus_kwargs.dll",)
    layer = {name: value for name, (value, _) in found.project.layer.items()}
    assert layer == {"channel": "/dev/ttyACM0", "bus_kwargs": ("receive_own_messages=false",)}


def test_a_folder_of_journals_stays_the_same_one(request: pytest.FixtureRequest) -> None:
    before = Path.cwd()
    request.addfinalizer(lambda: os.chdir(before))
    assert options_of({"journal": "kept"}).journal == str(before / "kept")
    Path("dvtcli.toml").write_text('journal = "kept"\n')
    trust_settings()
    Path("below").mkdir()
    os.chdir("below")
    found = Settings()
    found.read_files()
    assert found.start({})["journal"] == str(before.resolve() / "kept")


def test_trust_is_shown_and_taken_back(tmp_path: Path) -> None:
    env = environment() | homes(tmp_path)
    assert run(["trust"], cwd=tmp_path, env=env).returncode == 2, "there is none"
    file = tmp_path / "dvtcli.toml"
    file.write_text('node = 5\nyes = true\n[aliases]\nls = "pdo | sh"\n')
    shown = run(["trust"], cwd=tmp_path, env=env)
    for line in (
        "is trusted until it changes",
        "node = 5",
        "alias ls = pdo | sh",
        "never taken from a project's file: yes",
    ):
        assert line in shown.stdout
    (again,) = documents(run(["--json", "trust"], cwd=tmp_path, env=env).stdout)
    assert (again["trusted"], again["changed"], again["never_taken"]) == (True, False, ["yes"])
    (back,) = documents(run(["--json", "trust", "--remove", str(file)], cwd=tmp_path, env=env).stdout)
    assert (back["trusted"], back["changed"]) == (False, True)
    assert "(not trusted)" in run(["doctor"], cwd=tmp_path, env=env).stdout
    file.chmod(0o666)
    if os.name == "posix":
        assert run(["trust"], cwd=tmp_path, env=env).returncode == 6, "who could change it at any time?"


def trusted_here() -> bool:
    found = Settings()
    found.read_files()
    return found.project is not None and found.project.trusted


def test_a_dry_run_neither_keeps_nor_removes(tmp_path: Path) -> None:
    env = environment() | homes(tmp_path)
    (tmp_path / "dvtcli.toml").write_text("node = 5\n")

    def said(*words: str) -> tuple[bool, bool]:
        (document,) = documents(run(["--json", "trust", *words], cwd=tmp_path, env=env).stdout)
        return document["changed"], document["dry_run"]

    assert said("--dry-run") == (True, True)
    assert said() == (True, False), "nothing was kept"
    assert said("--remove", "--dry-run") == (True, True)
    assert said("--remove") == (True, False), "nothing was removed"
    assert said("--remove") == (False, False)


@pytest.mark.skipif(os.name == "nt", reason="links need a privilege on Windows")
def test_a_file_is_the_same_one_through_a_link() -> None:
    Path("dvtcli.toml").write_text("node = 5\n")
    Path("link").symlink_to(Path.cwd())
    trust_settings("link/dvtcli.toml")
    assert trusted_here()
    trust_settings("link/link/dvtcli.toml", remove=True)
    assert not trusted_here()


@pytest.mark.parametrize("now", [None, "no = = TOML\n", "node = 6\n"])
def test_trust_of_a_file_that_is_gone_or_wrong_is_taken_back(now: str | None) -> None:
    file = Path("dvtcli.toml")
    for content in ("node = 5\n", "node = 7\n"):
        file.write_text(content)
        trust_settings()
    file.unlink()
    if now is not None:
        file.write_text(now)
    removed = dict(trust_settings("dvtcli.toml", remove=True).rows)
    assert (removed["trusted"], removed["changed"]) == (False, True)
    for content in ("node = 5\n", "node = 7\n"):
        file.write_text(content)
        assert not trusted_here()


def test_a_file_with_an_alias_that_is_a_command_is_not_trusted(tmp_path: Path) -> None:
    env = environment() | homes(tmp_path)
    (tmp_path / "dvtcli.toml").write_text('[aliases]\nPdo = "nmt start"\n')
    ran = run(["trust"], cwd=tmp_path, env=env)
    assert ran.returncode == 4
    assert "the alias 'Pdo' is a command already" in ran.stderr
    (back,) = documents(run(["--json", "trust", "--remove"], cwd=tmp_path, env=env).stdout)
    assert not back["changed"]


def test_no_passcode_is_sent_where_a_project_s_file_says(tmp_path: Path) -> None:
    with served(tmp_path, "gen4-locked@1") as nodes:
        file = tmp_path / "dvtcli.toml"
        words = f'interface = "socketcand"\nchannel = "127.0.0.1:{nodes.port}"\nnode = 1\ntimeout = {ANSWER_S}\n'
        file.write_text(words)

        def login(*options: str, **variables: str) -> tuple[int, str]:
            env = own_environment(tmp_path) | {"DVTCLI_PASSCODE": RIGHT} | variables
            ran = run(["-v", *options, "login"], cwd=tmp_path, env=env)
            assert ran.returncode == 0 or "<-" not in ran.stderr, "nothing is written, not even the user ID"
            return ran.returncode, ran.stderr

        for options in ((), ("--yes",), ("--bus-kwargs", "x=1")):
            code, error = login(*options)
            assert code == 6
            assert "a network that" in error
        run(["trust"], cwd=tmp_path, env=own_environment(tmp_path))
        code, error = login("--yes")
        assert code == 6
        assert f"no terminal to answer on: {file} sets the bus" in error
        file.write_text("[bus.bench]\n" + words)
        assert login("--bus", "bench")[0] == 6, "the name is the user's, the address is not"
        assert login("--bus", "bench", DVTCLI_CONFIG=str(file))[0] == 0
        file.write_text(words)
        assert login("-i", "socketcand", "-c", f"127.0.0.1:{nodes.port}")[0] == 0, "the user's own words"
