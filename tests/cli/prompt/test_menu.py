"""What the menu offers, asked of the completer itself; no key uses the bus. Its speed: benchmarks/bench_keys.py."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import pytest
from prompt_toolkit.completion import CompleteEvent, Completion
from prompt_toolkit.document import Document

from dvtcli.cli.conversation import Conversation
from dvtcli.cli.name_completion import MOST
from dvtcli.cli.prompt.full_line import LineCompleter
from dvtcli.cli.prompt.line import quoted, typed_line
from dvtcli.cli.view.output import Output
from dvtcli.domain.pdo import DUMMY_BITS
from dvtcli.domain.rules.mapped_object import is_taken
from dvtcli.domain.rules.pdo_mapping import known_dummies
from dvtcli.simulator.network.family_file import family_names
from tests.harness.sample import heavy


@pytest.fixture
def session() -> Iterator[Conversation]:
    session = Conversation(Output())
    session.start({"sim": ("gen4",)})
    session.started = True
    session.node()
    yield session
    session.close()


def menu(session: Conversation, line: str) -> list[Completion]:
    return list(LineCompleter(session).get_completions(Document(line), CompleteEvent()))


def words(session: Conversation, line: str) -> list[str]:
    return [item.text for item in menu(session, line)]


def test_objects_are_found_by_number_then_name_then_a_word_of_it(session: Conversation) -> None:
    assert words(session, "read 6C01:1")[0] == "6C01:01"
    assert words(session, "read 0x606C")[0] == "0x606C:00"
    assert all(word.startswith("0x") for word in words(session, "read 0x6"))
    found = words(session, "read velocity_a")
    assert found[0] == "606C:00"
    assert words(session, 'read "velocity a')[0] == "606C:00"
    assert "606C:00" in words(session, "read vlctyctlvl")
    assert words(session, "read nothing_is_called_so") == []


def test_a_name_typed_without_its_blanks_is_found(session: Conversation) -> None:
    assert words(session, "read velocityactual")[0] == "606C:00"
    assert words(session, "map tpdo1 velocityactual")[0] == "606C:00"
    assert words(session, "read status_w")[0] == "6041:00"


def test_a_drives_usual_objects_come_first_and_dummies_before_parts_of_names(session: Conversation) -> None:
    assert words(session, "map tpdo1 ")[:3] == ["6041:00", "6040:00", "606C:00"]
    assert words(session, "map rpdo1 ")[0] == "6040:00"
    assert words(session, "map rpdo1 dum")[0] == "dummy/8"
    assert words(session, "read 60")[:2] == ["6041:00", "6040:00"]


def test_a_drive_with_a_position_is_offered_it_after_the_velocity() -> None:
    session = Conversation(Output())
    session.start({"sim": ("generic",)})
    session.started = True
    session.node()
    assert words(session, "map tpdo1 ")[:3] == ["6041:00", "606C:00", "6064:00"]  # its 6040 is for RPDOs only
    session.close()


def test_what_the_user_types_often_comes_before_what_devices_of_the_kind_map(session: Conversation) -> None:
    session.recent_lines = lambda: ["read 1018:1", "map tpdo1 606C,6077/16", "read 6077", "# 9999", "read 5:zz"]
    assert words(session, "map tpdo1 ")[:3] == ["6077:00", "606C:00", "6041:00"]
    assert words(session, "read 1018:0")[0] == "1018:01"
    session.recent_lines = tuple
    assert words(session, "read 1018:0")[0] == "1018:00"
    assert words(session, "read velocity_a")[0] == "606C:00"  # what begins so, before any other


def test_options_come_with_the_commands_own_first(session: Conversation) -> None:
    found = words(session, "map tpdo1 6041 --")
    assert found.index("--cob-id") < found.index("--dry-run")
    assert "--sim" not in found
    assert "--sync" not in words(session, "map tpdo1 6041 --sync 1 --s")
    assert words(session, "map tpdo1 6041 --cob-id ")[:2] == ["auto", "keep"]


def test_a_nodes_prefix_and_the_values_of_options_are_completed(session: Conversation) -> None:
    assert words(session, "pdo 1:tp")[:2] == ["1:tpdo1", "1:tpdo2"]
    assert words(session, "map 1:tpdo1 velocity_a")[0] == "606C:00"
    assert menu(session, "map rpdo1 60FF --type 25")[-1].display_meta_text == "event-driven; RPDO: immediate"
    assert "i16" in words(session, "read 6041 --as i")
    assert words(session, "nmt reset")[0] == "reset-node"


def test_a_continued_line_is_one_line(session: Conversation) -> None:
    (found, *_) = menu(session, "map tpdo1 \\\n606C:0")
    assert (found.text, found.start_position) == ("606C:00", -6)


def test_a_comment_and_an_unknown_command_offer_nothing(session: Conversation) -> None:
    assert words(session, "# ma") == []
    assert words(session, "mpa tp") == []


@pytest.mark.parametrize(("wrong", "meant"), [("mpa", "map"), ("sotr", "store"), ("pod", "pdo")])
def test_two_letters_that_were_swapped_offer_the_command_first(session: Conversation, wrong: str, meant: str) -> None:
    assert words(session, wrong)[0] == meant


def test_nothing_is_swapped_in_a_word_that_begins_a_command_or_is_short(session: Conversation) -> None:
    assert words(session, "set")[0] == "set"
    assert "map" not in words(session, "am")


def test_a_key_never_uses_the_bus(session: Conversation) -> None:
    bus = session.wire
    assert bus is not None
    frames: list[object] = []
    forget = bus.tap(lambda frame, _sent: frames.append(frame) if frame.can_id & 0x780 in (0x580, 0x600) else None)
    line = "map tpdo1 6C01:1 velocity 6041 --cob-id auto --sync 1"
    for end in range(len(line) + 1):
        menu(session, line[:end])
    assert frames == []
    bus.sdo(1).upload(0x1018, 1)
    forget()
    assert frames, "a read would have been seen"


@pytest.mark.parametrize("line", ["map tpdo1 ", "map tpdo1 v", "map rpdo1 2020", "map tpdo1 5100:01 2", "set tpdo1 --"])
def test_what_is_free_is_seen_at_80_columns_and_names_give_way(session: Conversation, line: str) -> None:
    offered = menu(session, line)
    assert offered
    for item in offered:
        assert len(f" {item.display_text}   {item.display_meta_text} ") < 80
        assert line.startswith("set") or item.display_meta_text.endswith(("free bytes", "free bits"))


@heavy
def test_a_large_dictionary_gives_a_menu_that_can_be_read(tmp_path: Path) -> None:
    eds = tmp_path / "large.eds"
    names = ["velocity actual", "torque demand", "motor temperature", "battery voltage"]
    objects = [
        f"[{0x2000 + n:04X}]\nParameterName={names[n % 4]} {n}\nObjectType=7\nDataType=6\nAccessType=rw\nPDOMapping=1\n"
        for n in range(5000)
    ]
    eds.write_text("[DeviceInfo]\nProductName=Large\n" + "".join(objects))
    session = Conversation(Output())
    session.start({"sim": (str(eds),)})
    session.started = True
    for line, first in [
        ("read vel", "2000:00"), ("read 27", "2700:00"), ("read voltage 4999", "3387:00"),
        ("read voltage_4999", "3387:00"), ("map rpdo1 2001 torque", "2005:00"), ("map rpdo1 2001 zqv", ""),
    ]:  # fmt: skip
        found = words(session, line)
        assert found[:1] == ([first] if first else []), line
        assert len(found) <= MOST
    session.close()


@pytest.mark.parametrize(
    ("text", "finished", "incomplete", "start"),
    [
        ("", [], "", 0),
        ("map", [], "map", 0),
        ("map ", ["map"], "", 4),
        ('read "Velocity act', ["read"], "Velocity act", 5),
        ("read driver's na", ["read", "driver's"], "na", 14),
        ("read 'a b' c", ["read", "a b"], "c", 11),
    ],
)
def test_a_line_is_taken_apart_while_it_is_typed(text: str, finished: list[str], incomplete: str, start: int) -> None:
    line = typed_line(text)
    assert line is not None
    assert (line.words, line.incomplete, line.start) == (finished, incomplete, start)


def test_a_word_with_blanks_is_quoted() -> None:
    assert [quoted(word) for word in ("6041:00", "a b", 'a "b"')] == ["6041:00", '"a b"', "'a \"b\"'"]


@pytest.mark.drawn(3)
@pytest.mark.parametrize("family", sorted({*family_names()} - {"generic"}))
def test_a_mapping_is_offered_what_map_takes_and_nothing_else(family: str) -> None:
    session = Conversation(Output())
    session.start({"sim": (family,)})
    session.started = True
    try:
        node = session.node()
        assert node.dictionary is not None
        entries = {entry.object: entry for entry in node.dictionary.entries() if 0x2000 <= entry.index < 0xA000}
        for way in ("tpdo", "rpdo"):
            taken = {
                place
                for place, entry in entries.items()
                if is_taken(node.profile, node.dictionary, entry, tpdo=way == "tpdo") and (entry.bits or 1) <= 64
            }
            for place in random.Random(5).sample(sorted(entries), min(len(entries), 80)):
                offered = place in words(session, f"map {way}1 {place}")
                assert offered is (place in taken), (way, place)
    finally:
        session.close()


def test_what_an_rpdo_has_already_and_dummies_that_the_device_lacks_are_not_offered(session: Conversation) -> None:
    (target,) = [word for word in words(session, "map rpdo1 60FF") if word.startswith("60FF")]
    assert target not in words(session, f"map rpdo1 {target} 60FF")
    assert "606C:00" in words(session, "map tpdo1 606C 606C"), "a TPDO may send an object twice"
    node = session.node()
    known = known_dummies(node.dictionary, node.profile)
    assert known is not None
    lengths = {f"dummy/{DUMMY_BITS[index]}" for index in known}
    assert set(words(session, "map rpdo1 dummy/")) == lengths
