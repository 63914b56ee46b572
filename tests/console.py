"""Sessions at a shell as text: `$ dvtcli …` lines with what they print, run for real and compared.

    $ dvtcli --sim gen4 map tpdo1 1018:1
    error: …
    $ echo $?
    1
    $ dvtcli --sim gen4 <<END
    map tpdo1 6041
    END

Standard output and error come together, as at a terminal. `$ cat FILE` shows a file that a command wrote. `$ echo $?`
gives the exit code of the command before; where it is missing, it must be 0. A line `[…]` stands for any lines.
Times are not compared.
"""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

from tests.process import dvtcli
from tests.surroundings import ROOT

ELISION = "[…]"


@dataclass
class Command:
    """One command with what it should print; *stdin* is a here-document."""

    line: str
    stdin: list[str]
    output: list[str]
    code: int = 0
    shows_code: bool = False

    def text(self) -> list[str]:
        """The command as the session shows it."""
        here = [*self.stdin, "END"] if self.line.endswith("<<END") else []
        code = ["$ echo $?", str(self.code)] if self.shows_code else []
        return [f"$ {self.line}", *here, *self.output, *code]


def commands(lines: list[str]) -> list[Command]:
    """The commands of a session."""
    found: list[Command] = []
    rest = iter(lines)
    for line in rest:
        if line == "$ echo $?":
            found[-1].code, found[-1].shows_code = int(next(rest)), True
        elif line.startswith("$ "):
            here = list(iter(rest.__next__, "END")) if line.endswith("<<END") else []
            found.append(Command(line[2:], here, []))
        else:
            assert found, f"a session begins with a command, not with {line!r}"
            found[-1].output.append(line)
    return found


def workplace(folder: Path) -> Path:
    """*folder* with the project's scripts and tests in it, and a firmware with its EDS: where sessions are run."""
    for name in ("examples", "scripts", "tests"):
        (folder / name).symlink_to(ROOT / name)
    (folder / "fw").mkdir()
    for name in ("pump.eds", "pump.hex"):
        (folder / "fw" / name).symlink_to(ROOT / "tests/transcripts" / name)
    return folder


def run(command: Command, folder: Path) -> Command:
    """Run *command* in *folder*; what it really printed and its exit code."""
    words = shlex.split(command.line.removesuffix("<<END"))
    assert not any(word.startswith("#") for word in words), f"a comment would be typed: {command.line}"
    if words[0] == "cat":
        return Command(command.line, [], (folder / words[1]).read_text("utf-8").splitlines())
    assert words[0] == "dvtcli", f"sessions run dvtcli, not {words[0]}"
    done = dvtcli(*words[1:], stdin="\n".join([*command.stdin, ""]), cwd=folder, merge=True)
    said = [line for line in done.stdout.splitlines() if not _PROGRESS.fullmatch(line)]
    return Command(command.line, command.stdin, said, done.returncode, command.shows_code)


#: how far a command is that takes more than seconds, as it may on a busy machine
_PROGRESS = re.compile(r"node \d+: reading 0x\w{4}:\w\w of \w+, PDO \d+ of \d+")

_VOLATILE = [
    (re.compile(r"\b\d+\.\d{1,3} s\b"), "0.00 s"),
    (re.compile(r"\b\d\d:\d\d:\d\d\.\d{3}\b"), "00:00:00.000"),
    (re.compile(r"\bafter \d+\.\d ms"), "after 0.0 ms"),
    (re.compile(r'"(seconds|ms)":\d+(\.\d+)?'), r'"\1":0.0'),
]


def steady(text: str) -> str:
    """*text* with every time made the same."""
    for pattern, replacement in _VOLATILE:
        text = pattern.sub(replacement, text)
    return text


def same(expected: list[str], real: list[str]) -> bool:
    """Whether *real* is what was *expected*, elisions and times aside."""
    pattern = r"\n".join(
        r"(?:.*\n)*?.*" if line == ELISION else re.escape(steady(line)) for line in (line.rstrip() for line in expected)
    )
    return re.fullmatch(pattern, "\n".join(steady(line).rstrip() for line in real)) is not None


def compare(session: list[str], folder: Path) -> None:
    """Run a session and fail at the first command that prints or answers something else."""
    for command in commands(session):
        real = run(command, folder)
        shown = "\n".join(real.output)
        assert real.code == command.code, f"$ {command.line}\nexit code {real.code}, not {command.code}\n{shown}"
        if not same(command.output, real.output):
            expected, got = ("".join(f"{steady(line)}\n" for line in lines) for lines in (command.output, real.output))
            assert got == expected, f"$ {command.line}\n{shown}"


def rewritten(session: list[str], folder: Path) -> list[str]:
    """The session with what its commands print now; outputs that only differ in times, or have an elision, stay."""
    lines: list[str] = []
    for command in commands(session):
        real = run(command, folder)
        assert real.code != 70, f"$ {command.line}\n" + "\n".join(real.output)
        if ELISION in command.output or same(command.output, real.output):
            real.output = command.output
        real.shows_code = real.code != 0
        lines += real.text()
    return lines
