"""Every file that dvtcli writes is read back by its own reader before it is called done, or is not there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dvtcli.errors import InputFileError, UsageError
from dvtcli.operations.session.whole_file import write_whole
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.small_eds import U16, plain, var


def odd(kind: str) -> bytes:
    """An EDS that is odd in one way, as real ones are."""
    eds = plain()
    eds.variable(0x2001, var("Speed limit", U16, 7))
    eds.variable(0x2002, var("Ramp; up = 5 % [a/b] °C", U16, 9))
    text = eds.text()
    lists = {
        "mandatory": ("MandatoryObjects", "0x1002"),
        "optional": ("OptionalObjects", "0x9FFF"),
        "maker": ("ManufacturerObjects", "0x5FF0"),
        "first": ("OptionalObjects", "0x1002"),
    }
    if kind in lists:
        name, index = lists[kind]
        keys = re.search(rf"(?s)\[{name}\]\n(.*?)\n\n", text)
        assert keys is not None
        rows = keys[1].split("\n")
        values = [row.partition("=")[2] for row in rows[1:]]
        values = [index, *values] if kind == "first" else [*values, f"{index} ; not there"]
        made = [f"SupportedObjects={len(values)}", *(f"{n}={value}" for n, value in enumerate(values, 1))]
        text = text.replace(keys[1], "\n".join(made))
    elif kind == "every":
        text = re.sub(r"SupportedObjects=(\d+)", lambda found: f"SupportedObjects={int(found[1]) + 1}\n99=0x5FFF", text)
    elif kind == "count":
        text = re.sub(r"SupportedObjects=\d+", "Supported Objects=0", text)
    elif kind == "lists":
        text = re.sub(r"(?s)\[(?:Mandatory|Optional|Manufacturer)Objects\]\n.*?\n\n", "", text)
    elif kind == "twice":
        text += "\n[2001]\nParameterName=Speed limit again\nObjectType=7\nDataType=6\nAccessType=rw\nDefaultValue=8\n"
    if kind == "utf-16":
        return text.encode("utf-16")
    if kind == "cp1252":
        return text.encode("cp1252")
    return text.replace("\n", "\r\n").encode() if kind == "crlf" else text.encode()


KINDS = (
    "plain", "mandatory", "optional", "maker", "first", "every", "count", "lists", "twice", "utf-16", "cp1252", "crlf",
)  # fmt: skip
#: what writes a file of that suffix, and a line that reads it then
WRITERS = {
    ".dcf": ("backup {}", "compare {}"),
    ".xdc": ("backup {}", "compare {}"),
    ".jsonl": ("backup {}", "compare {}"),
    ".e.dcf": ("export {}", "verify {}"),
    ".e.xdc": ("export {}", "verify {}"),
    ".yaml": ("export {}", "plan {}"),
    ".dbc": ("export {}", "decode - -d {}"),
    ".cpj": ("export {}", "plan {}"),
    ".c.eds": ("eds convert {eds} {}", "eds show {}"),
    ".c.dcf": ("eds convert {eds} {}", "eds show {}"),
    ".xdd": ("eds convert {eds} {}", "eds show {}"),
    ".c.xdc": ("eds convert {eds} {}", "eds show {}"),
    ".dvt": ("save {}", "run {} --dry-run"),
    ".309": ("save {}", "run {} --dry-run"),
    ".json": ("plan {yaml} -o {}", "apply {} --dry-run"),
    ".svg": ("report {}", ""),
}


@pytest.mark.drawn(24)
@pytest.mark.parametrize("suffix", WRITERS)
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_of_an_odd_file_is_read_by_its_own_reader_or_is_not_there(
    tmp_path: Path, kind: str, suffix: str
) -> None:
    eds, made, yaml = tmp_path / "odd.eds", tmp_path / f"made{suffix}", tmp_path / "net.yaml"
    eds.write_bytes(odd(kind))
    yaml.write_text("nodes:\n  a: {node_id: 1, heartbeat_producer: 700}\n", "utf-8")
    write, read = WRITERS[suffix]
    with Bench((str(eds),), {"yes": True}) as bench:
        assert bench.run("set tpdo1 --sync 3").code == 0
        ran = bench.run(write.format(made, eds=eds, yaml=yaml))
        assert [path.name for path in tmp_path.iterdir() if path.name.endswith(".new" + made.suffix)] == []
        if ran.code:
            assert not made.exists(), ran
            return
        if suffix in (".dbc", ".cpj", ".svg"):
            assert made.stat().st_size
            return
        again = bench.run(read.format(made))
        assert again.code == 0, (ran, again)


@heavy
def test_no_backup_of_these_files_is_refused(tmp_path: Path) -> None:
    """What a list names and nothing describes is left out, and said."""
    for kind in KINDS:
        eds, made = tmp_path / f"{kind}.eds", tmp_path / f"{kind}.dcf"
        eds.write_bytes(odd(kind))
        with Bench((str(eds),), {"yes": True}) as bench:
            ran = bench.run(f"backup {made}")
            assert ran.code == 0, ran
            said = "(it is in a list, but has no section)" in ran.stdout
            assert said is (kind in ("mandatory", "optional", "maker", "first", "every")), (kind, ran)
            assert bench.run(f"compare {made}").code == 0, kind
            assert bench.run(f"eds check {made}").stdout.count("no section") == 0, kind


def refuse(_path: Path) -> None:
    raise InputFileError("it is cut short", why="an object is missing")


@pytest.mark.parametrize("linked", [False, True])
@pytest.mark.parametrize("was", [None, b"what was there"])
def test_what_cannot_be_read_back_leaves_what_was_there(tmp_path: Path, was: bytes | None, *, linked: bool) -> None:
    path = tmp_path / "made.dcf"
    target = tmp_path / "elsewhere" / "real.dcf" if linked else path
    target.parent.mkdir(exist_ok=True)
    if linked:
        path.symlink_to(target)
    if was is not None:
        target.write_bytes(was)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputFileError) as caught:
        write_whole(path, b"half", refuse)
    assert caught.value.text == f"{path} is not written: its content cannot be read back"
    assert caught.value.why == "it is cut short: an object is missing"
    assert sorted(tmp_path.rglob("*")) == before
    assert (target.read_bytes() if target.exists() else None) == was


def test_the_reader_finds_what_was_written_under_the_same_suffix(tmp_path: Path) -> None:
    seen: list[tuple[str, bytes]] = []
    write_whole(tmp_path / "made.dcf", b"whole", lambda path: seen.append((path.suffix, path.read_bytes())))
    assert seen == [(".dcf", b"whole")]
    assert (tmp_path / "made.dcf").read_bytes() == b"whole"
    with pytest.raises(UsageError):
        write_whole(tmp_path / "no" / "made.dcf", b"whole", refuse)
