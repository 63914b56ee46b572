"""What no file writes: on every family, by every way that a file has, with and without `--include`."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dvtcli.domain.object_dictionary import OdEntry
from dvtcli.domain.ports import Frame
from tests.cli.commands.bench import Bench
from tests.operations.devices.test_export_dcf import FAMILIES
from tests.operations.gateway.clients import Client, served

NODE = 5
#: the list, by numbers of the standards alone (CiA 301, 302-3, 401, 402), and what a Sevcon takes a login by
_ANYWHERE = {0x1003, 0x100B, 0x1010, 0x1011, 0x1020, *range(0x1F50, 0x1F60), 0x5000}
_OUTPUTS = {0x6200, *range(0x6220, 0x6228), 0x6300, 0x6320, *range(0x6410, 0x6415)}
_COMMANDS = {0x6040, 0x6042, 0x6052, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60B8, 0x60C1, 0x60FE, 0x60FF}
NEVER = _ANYWHERE | {axis + index for axis in range(0, 0x4000, 0x800) for index in _OUTPUTS | _COMMANDS}


def forbidden(bench: Bench) -> list[OdEntry]:
    """The objects of the node's dictionary that are on the list."""
    dictionary = bench.session.node().dictionary
    assert dictionary is not None
    found = [entry for index in dictionary for entry in dictionary[index].entries.values()]
    return [entry for entry in found if entry.index in NEVER and entry.sub_index not in _counts(found, entry)]


def _counts(found: list[OdEntry], entry: OdEntry) -> set[int]:
    """Sub-index 0, where there are others."""
    return {0} if sum(one.index == entry.index for one in found) > 1 and entry.index != 0x1003 else set()


@contextmanager
def written(bench: Bench) -> Iterator[set[tuple[int, int]]]:
    """The objects to which something was written inside of it."""
    seen: set[tuple[int, int]] = set()

    def look(frame: Frame, sent: bool) -> None:
        if (
            sent
            and frame.can_id in range(0x601, 0x680)
            and frame.data[0] >> 5 in (1, 6)
            and not (frame.data[0] >> 5 == 6 and frame.data[0] & 1)
        ):
            seen.add((int.from_bytes(frame.data[1:3], "little"), frame.data[3]))

    untap = bench.session.open_network().bus.tap(look)
    try:
        yield seen
    finally:
        untap()


def named(entry: OdEntry) -> str:
    return f"{entry.index:04X}:{entry.sub_index:X}"


def dcf_of(family: str, folder: Path) -> tuple[Path, list[OdEntry]]:
    """A DCF that says another value for everything on the list, and for the heartbeat; and what of the list it says."""
    folder.mkdir(exist_ok=True)
    file = folder / "node.dcf"
    with Bench((f"{family}@{NODE}",)) as bench:
        assert bench.run("write 1017 777").code == 0
        assert bench.run(f"export {file}").code == 0
        never = [entry for entry in forbidden(bench) if (entry.index, entry.sub_index) != (0x1003, 0)]
    text = file.read_text("latin-1")
    for entry in never:
        sections = {f"{entry.index:04X}sub{entry.sub_index:X}"} | (
            {f"{entry.index:04X}"} if not entry.sub_index else set()
        )
        found = re.search(rf"(?im)^\[({'|'.join(sections)})\]\r?\n((?!\[).*\r?\n)*?(?=\s*(\[|\Z))", text)
        assert found is not None, named(entry)
        kept = re.sub(r"(?im)^ParameterValue=.*\n", "", found[0]).rstrip()
        text = f"{text[: found.start()]}{kept}\nParameterValue=0x5\n{text[found.end() :]}"
    file.write_text(text, "latin-1")
    return file, never


def included(never: list[OdEntry]) -> str:
    """All that `--include` could be asked: each object, each sub-index of it, and all of them at once."""
    words = dict.fromkeys([*map(named, never), *(f"{one.index:04X}" for one in never), "1000-9FFF"])
    return " ".join(f"--include {word}" for word in words)


def imported(file: Path) -> str:
    """A network file that was made of *file*, which nobody has read."""
    network = file.parent.parent / "line.yaml"
    assert Bench().run(f"import {network} {file.parent}").code == 0
    return f"apply {network} --yes"


def planned(bench: Bench, file: Path, words: str) -> str:
    plan = file.with_suffix(".json")
    assert bench.run(f"plan {file} -o {plan} {words}").code == 0
    return f"apply {plan} --yes"


Way = Callable[[Bench, Path, list[OdEntry]], str]
WAYS: dict[str, Way] = {
    "apply": lambda _bench, file, _never: f"apply {file} --yes",
    "apply --include": lambda _bench, file, never: f"apply {file} --yes {included(never)}",
    "apply --include --force": lambda _bench, file, never: f"apply {file} --yes --force {included(never)}",
    "clone": lambda _bench, file, _never: f"clone {file} --yes",
    "clone --include --force": lambda _bench, file, never: f"clone {file} --yes --force {included(never)}",
    "a saved plan": lambda bench, file, never: planned(bench, file, included(never)),
    "import": lambda _bench, file, _never: imported(file),
}


@pytest.mark.drawn(6, "never written")
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("family", FAMILIES)
def test_nothing_on_the_list_is_written_for_a_files_sake(family: str, way: str, tmp_path: Path) -> None:
    file, never = dcf_of(family, tmp_path / "files")
    assert never, "each family has something on the list"
    with Bench((f"{family}@{NODE}",), in_real_time=True) as bench:
        bench.session.node()
        line = WAYS[way](bench, file, never)
        with written(bench) as seen:
            ran = bench.run(line)
        assert {f"{index:04X}:{sub:X}" for index, sub in seen if index in NEVER} == set()
        if "does not name its product" in ran.stderr:  # a clone replaces the same product, which is to be known
            assert (ran.code, way[:5], seen) == (6, "clone", set())
            return
        assert ran.code in (0, 3), ran.stderr
        if way != "import":  # whose file is about PDOs, and what joins nodes
            assert (0x1017, 0) in seen, "what may be written is"


@pytest.mark.drawn(2, "never written")
@pytest.mark.parametrize("family", FAMILIES)
def test_what_somebody_writes_himself_has_one_rule_by_every_way(family: str, tmp_path: Path) -> None:
    """`write`, a line of a gateway's script, and a gateway's client: all of them write it, or none does."""
    with Bench((f"{family}@{NODE}",)) as bench:
        never = forbidden(bench)
    script = tmp_path / "one.309"
    for entry in never:
        kind = entry.data_type
        size = 8 if kind is None or kind.bits is None else kind.bits
        script.write_text(f"[1] {NODE} write 0x{entry.index:X} {entry.sub_index} u{size} 5\n")
        outcomes = {}
        for line in (f"write {named(entry)} 5 --yes --as u{size}", f"run {script} --yes"):
            with Bench((f"{family}@{NODE}",), in_real_time=True) as bench, written(bench) as seen:
                ran = bench.run(line)
                outcomes[line.split()[0]] = (ran.code == 0, (entry.index, entry.sub_index) in seen)
        with served(f"{family}@{NODE}") as (_, running), Client(running) as client:
            said = client.answer(f"[1] {NODE} write 0x{entry.index:X} {entry.sub_index} u{size} 5")
            outcomes["gateway"] = said == "OK", outcomes["run"][1]
        assert len(set(outcomes.values())) == 1, (named(entry), outcomes, said)
