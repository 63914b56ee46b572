"""Every command that a failure prints runs as it is printed, and does what it says; so does what a success prints."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from dvtcli.cli.view.typed_hints import PLACEHOLDER
from tests.cli.commands.bench import Bench, Ran
from tests.cli.commands.program.hint_promises import PROMISES, action_of, behind_the_bus
from tests.cli.commands.program.test_bad_input import WRONG

#: further lines that fail on a node of the family gen4, or on two of them
FAILING = (
    "pdo tpdo9", "map tpdo9 6041", "map tpdo2 6041 --cob-id 0x181", "map tpdo1 9999", "set tpdo9 --timer 5",
    "set rpdo1 --cob-id 0x301 --off --type 252", "disable tpdo9", "clear tpdo9", "link 1:rpdo1 5:rpdo2", "link 1:tpdo1",
    "unlink 1:tpdo1", "write 1800:1 0x191", "write 1800:3 20", "write 1A00:1 1", "write 1010:1 abc", "write 1011:1 abc",
    "write 1017 1h", "read 1010 --as xx", "read 1018 --every 1s -o x.txt",
    "undo", "undo --backup", "verify", "verify tpdo1", "verify nofile.dcf", "save x.txt", "save x.dvt",
    "export x.txt", "export x.dcf --with emcy", "export x.dbc --twice", "import x.txt", "plan nofile.yaml",
    "diff m.yaml --format sarif", "compare nofile.dcf", "compare gen4.eds", "clone nofile.dcf", "backup .",
    "eds show nix", "eds add nofile.eds", "eds remove nix", "eds check nix", "decode nofile.log", "replay nofile.log",
    "log x.nix", "report x.nix", "lss store 9",
    "login 5", "faults --clear", "vpdo out", "learn --save Bad", "learn --save gen4",
    "learn --compare ./nix", "download nofile.bin", "nmt start 99", "restore --prove application",
    "store --prove power --within 0.001", "recover --accept", "recover --finish", "require vendor=0x99",
    "require power-off", "send 999999#", "sync --check", "explain nix", "profiles show nix",
)  # fmt: skip
#: lines that succeed, each with those before it, which say what comes next
SAYING = (
    ("plan m.yaml",),
    ("export h.dcf",),
    ("export one.yaml",),
    ("backup b.jsonl",),
    ("import net.yaml",),
    ("set tpdo1 --timer 50", "save s.dvt"),
)
NETWORK = "nodes: {a: {node_id: 5, tpdo: {1: {event_timer: 50}}}}\n"
_COMMAND = re.compile(r"`(dvtcli [^`]+)`|(?:Run it|Check it|Next|Compare): (dvtcli .+)$", re.M)
#: commands that end with Ctrl-C only
_ENDLESS = re.compile(r"dvtcli .*(?:\b(?:monitor|log|gateway|bitrate)\b|--every)")


@pytest.mark.drawn(6)
@pytest.mark.parametrize("line", list(dict.fromkeys([*FAILING, *(line for line, *_ in WRONG)])))
def test_what_a_failure_prints_runs(line: str) -> None:
    Path("m.yaml").write_text(NETWORK, "utf-8")
    with Bench(("gen4",), {"yes": True}) as bench:
        ran = bench.run(line)
    for command in commands(ran):
        then = run(command, ("gen4",))
        assert then.code in (0, 3), f"{line}: {command}: {then}"
        if f"`{command}` first" in ran.stderr:
            with Bench(("gen4",), {"yes": True}) as bench:
                keeps(bench, shlex.join(behind_the_bus(command)))
                assert ran.stderr.splitlines()[0] not in bench.run(line).stderr


@pytest.mark.drawn(2)
@pytest.mark.parametrize("lines", SAYING, ids=lambda lines: lines[-1])
def test_what_comes_next_runs(lines: tuple[str, ...]) -> None:
    Path("m.yaml").write_text(NETWORK, "utf-8")
    with Bench(("generic@5",), {"yes": True}) as bench:
        ran = [bench.run(line) for line in lines][-1]
    assert ran.code == 0, ran
    printed = list(commands(ran))
    assert printed, ran
    for command in printed:
        then = run(command, ("generic@5",))
        assert then.code in (0, 3), f"{lines}: {command}: {then}"


@pytest.mark.parametrize(("file", "text"), [("s.dvt", "pdo tpdo9\n"), ("s.tcl", "dvtcli pdo tpdo9\n")])
def test_the_hint_of_a_script_in_a_report_runs(file: str, text: str) -> None:
    Path(file).write_text(text, "utf-8")
    with Bench(("gen4",), {"yes": True}) as bench:
        ran = bench.run(f"run {file} --format junit")
    assert "hint: `dvtcli --sim gen4 pdo --all` lists its PDOs" in ran.stdout, ran
    assert run("dvtcli --sim gen4 pdo --all", ("gen4",)).code == 0


def commands(ran: Ran) -> Iterator[str]:
    """The commands that *ran* printed, without those in which a word stands for another one."""
    for found in _COMMAND.finditer(ran.stderr + ran.stdout):
        command = found[1] or found[2]
        if not any(re.fullmatch(PLACEHOLDER, word) for word in shlex.split(command)) and not _ENDLESS.match(command):
            yield command


def run(command: str, sim: tuple[str, ...]) -> Ran:
    """What *command* does as a process of its own would, where nothing is left of the one before."""
    words = shlex.split(command)[1:]
    while words[0] == "--sim":
        assert words[1] in sim
        words = words[2:]
    with Bench(sim, {"yes": True}) as bench:
        return keeps(bench, shlex.join(words))


def keeps(bench: Bench, command: str) -> Ran:
    """What *command* does on *bench*, where it ends well and keeps what its action promises."""
    ran = bench.run(command)
    assert ran.code in (0, 3), f"{command}: {ran}"
    action, arguments = action_of(behind_the_bus(f"dvtcli {command}"))
    promise = PROMISES[action]
    then = bench.run(promise.then.format(*arguments)) if promise.then else ran
    said = re.sub(r"\{(\d)\}", lambda at: re.escape(arguments[int(at[1])].removesuffix(".0")), promise.prints)
    assert re.search(said, then.stdout + then.stderr, re.S), f"{command}: {then}"
    return ran


@pytest.mark.parametrize("key", ["dcf", "profile"])
def test_an_unknown_family_of_a_network_file_is_answered_with_those_there_are(key: str) -> None:
    Path("q.yaml").write_text(f"nodes: {{a: {{node_id: 5, {key}: qqqqqqq}}}}\n", "utf-8")
    with Bench(()) as bench:
        ran = bench.run("check q.yaml")
    assert ran.code == 4, ran
    assert "canopennode, " in ran.stdout + ran.stderr, ran
