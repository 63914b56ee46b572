"""Text from a device, a file, a peer or the network is made safe at each sink: sinks are walked, not commands."""

from __future__ import annotations

import csv
import io
import json
import re
import tomllib
import unicodedata
import xml.etree.ElementTree as ET
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from fractions import Fraction
from pathlib import Path

import pytest
from click.shell_completion import CompletionItem
from hypothesis import example, given
from hypothesis import strategies as st
from prompt_toolkit.completion import CompleteEvent
from prompt_toolkit.document import Document

from dvtcli.cli.conversation import Conversation
from dvtcli.cli.name_completion import safe_items
from dvtcli.cli.prompt.full_line import LineCompleter
from dvtcli.cli.view.lines import Cell, painted
from dvtcli.cli.view.output import Output
from dvtcli.cli.view.reports import github_error_lines, github_lines, junit_error_lines, sarif_lines
from dvtcli.device.change.change_history import ChangeHistory
from dvtcli.device.change.journal import JournalFolder
from dvtcli.device.change.private_file import file_name
from dvtcli.domain.datatypes import BY_SHORT_NAME
from dvtcli.domain.network.picture import (
    NetworkPicture,
    PictureDifference,
    PictureFinding,
    PictureLoad,
    PictureNode,
)
from dvtcli.domain.object_dictionary import ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.rules.finding import FileComplaint
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files import dbc as dbc_files
from dvtcli.files import learnt_folder
from dvtcli.files.device_library import folder as library_folder
from dvtcli.files.device_library import stored_place
from dvtcli.files.eds.write_dcf import Commissioned, write_dcf
from dvtcli.files.eds.writer import eds_text
from dvtcli.files.nodelist import ListedNode, Nodelist, nodelist_text
from dvtcli.files.picture import wiring
from dvtcli.files.picture.page import page
from dvtcli.files.picture.wiring import graphviz
from dvtcli.files.values.text_values import csv_text
from dvtcli.operations.devices.learn_device import refuse_name
from dvtcli.operations.results import Facts, FileFinding, FileReport, FileRule

#: what a stranger's file has in a name: commands of terminals, of shells, formulas, ends of strings and of markup
HOSTILE = (
    *("\x1b]52;c;cm0gLXJmIH4K\x07", "\x1b]8;;http://x\x1b\\click\x1b]8;;\x1b\\", "\x9b31m", "a\u202eb", "\u2028x"),
    *("::add-mask::x", " ::stop-commands::x", "a ##[error]x", "a]\n[b]", "{a|<b> c}", '"]; x [label="'),
    *('=HYPERLINK("http://x")', "+1", "-1", "@SUM(1)", "\t=1", "\r=1", "\r\nx", "a\0b", "\ud800", "\\", '"""'),
    *("'; rm -rf ~; '", "$(id)", "`id`", "|id", "../../x", '";\nBO_ 1 X: 8 A'),
    *("</title><script>alert(1)</script>", "]]>", '" onload="x', "&lt;"),
)
STEERING = {"Cc", "Cf", "Cs", "Co", "Zl", "Zp"}


def steers(text: str) -> str:
    """The characters of *text* that could steer who shows it."""
    return "".join(char for char in text if unicodedata.category(char) in STEERING)


def terminal(text: str) -> None:
    for colored in (False, True):
        shown = painted([Cell(text, "bold"), Cell(text)], io.StringIO(), colored=colored, plain=False, width=0)
        assert steers(re.sub(r"\x1b\[\d+m", "", shown)) == ""


def wrapped(text: str) -> None:
    assert steers(painted([Cell(text)], io.StringIO(), colored=False, plain=True, width=20).replace("\n", "")) == ""


def messages(text: str) -> None:
    """Notes and warnings; and documents, which are ASCII on one line."""
    out, error = io.StringIO(), io.StringIO()
    output = Output(out, error)
    output.note(text)
    output.warning(text)
    output.told({"text": text})
    output.documents([{"text": text}])
    assert steers(error.getvalue().replace("\n", "")) == ""
    assert out.getvalue().isascii()
    assert out.getvalue().count("\n") == 1
    assert json.loads(out.getvalue())["text"] == text


def completion(text: str) -> None:
    for item in safe_items([CompletionItem(text, help=text), CompletionItem("plain", help=text)]):
        assert steers(item.value + (item.help or "")) == ""


def csv_cells(text: str) -> None:
    cell = csv_text(text)
    assert not cell.startswith(("=", "+", "-", "@", "\t", "\r"))
    assert cell.removeprefix("'") in (text, text.removeprefix("'"))
    file = io.StringIO(newline="")
    csv.writer(file).writerow([cell, "next"])
    if "\0" not in text:
        assert next(csv.reader(io.StringIO(file.getvalue(), newline=""))) == [cell, "next"]


def pages(text: str) -> None:
    root = wiring.drawing(100, 100, text, text)
    wiring.add(root, "text", text, id=text)
    read = ET.fromstring(wiring.markup(root))  # noqa: S314 - our own
    assert not [one for one in read.iter() if one.tag.endswith("script")]
    assert all(not name.startswith("on") for one in read.iter() for name in one.attrib)
    assert steers("".join(read.itertext()).replace("\n", "")) == ""


def junit(text: str) -> None:
    error = InputFileError(text, place=text, why=text, hint=text)
    read = ET.fromstring("\n".join(str(line) for line in junit_error_lines(error)))  # noqa: S314 - our own
    assert [one.tag for one in read.iter()][-2:] == ["testcase", "error"]
    assert steers("".join(read.itertext()).replace("\n", "")) == ""


def dbc(text: str) -> None:
    quoted = dbc_files.quoted(text)
    assert quoted[0] == quoted[-1] == '"'
    assert not set('"\\\n') & set(quoted[1:-1])
    assert steers(quoted) == ""


def toml(text: str) -> None:
    quoted = learnt_folder.quoted(text)
    assert steers(quoted) == ""
    assert isinstance(tomllib.loads(f"a = {quoted}")["a"], str)


def names(text: str) -> None:
    assert re.fullmatch(r"[A-Za-z0-9._]+", file_name(text))
    assert "/" not in file_name(text)


def annotations(text: str) -> None:
    """Workflow commands of GitHub: each line is one of ours, or none."""
    wrong = FileFinding(1, "warning", "bad-line", text, text)
    report = FileReport(text, 1, 1, 1, (FileRule("bad-line", "warning", text, text),), (wrong,), strict=True)
    error = InputFileError(text, place=text, why=text, hint=text)
    error.complaints = (FileComplaint(text, 1, 1, text),)
    out = io.StringIO()
    output = Output(out, io.StringIO())
    lines = [*map(str, github_lines(report, 0)), *map(str, github_error_lines(error))]
    for line in lines:
        output.result(Facts(text, (), (line,)))
    shown = out.getvalue().splitlines()
    assert steers("".join(shown)) == ""
    assert len(shown) == len(lines)
    ours = ("::warning file=", "::error file=", *(() if text else ("::warning line=", "::error line=")))  # no file name
    for line in shown:
        is_command = line.startswith(ours)
        assert is_command or (not line.lstrip().startswith("::") and "##[" not in line)


def sarif(text: str) -> None:
    """Of a file whose name is no UTF-8, too."""
    text = text.encode("utf-8", "surrogatepass").decode("utf-8", "surrogateescape")
    wrong = FileFinding(1, "warning", "bad-line", text, text)
    report = FileReport(text, 1, 1, 1, (FileRule("bad-line", "warning", text, text),), (wrong,), strict=True)
    lines = [str(line) for line in sarif_lines(report, 0)]
    assert all(line.isascii() and line.isprintable() for line in lines)
    (run,) = json.loads("\n".join(lines))["runs"]
    assert run["results"][0]["message"]["text"] == text
    assert re.fullmatch(r"[\w.~/%:-]*", run["artifacts"][0]["location"]["uri"], re.ASCII)


def report_page(text: str) -> None:
    shown = page(_picture(text)).decode()
    assert steers(shown.replace("\n", "")) == ""
    plain = page(_picture("x")).decode()
    for tag in ("<script", "</script", "<title", "</title", "<style", "<b>", "<!--"):
        assert shown.count(tag) == plain.count(tag)


def graph(text: str) -> None:
    """Graphviz: a quoted string ends at the first quote that no backslash stands before."""
    shown = graphviz(_picture(text)).decode()
    lines = shown.splitlines()
    assert steers("".join(lines)) == ""
    assert len(lines) == 6
    outside = re.sub(r'"(?:\\.|[^"\\])*"', "S", shown)
    assert re.sub(r"\s+", " ", outside) == (
        "digraph S { rankdir=LR; node [shape=record, fontname=S, fontsize=11]; edge [fontname=S, fontsize=9]; "
        "n1 [label=S]; } "
    )
    (label,) = re.findall(r'n1 \[label="(.*)"\];', shown)
    assert not re.search(r"(?<!\\)(?:\\\\)*[{}|<>]", label[1:-1]), "it makes fields of its own"


def _picture(text: str) -> NetworkPicture:
    load = PictureLoad(500_000, Fraction(0), Fraction(0), fits=True, assumed=(text,))
    node = PictureNode(1, text, text, ((text, text),))
    finding = PictureFinding("error", text, text, 1, 1)
    differing = (PictureDifference(1, text, text, text, text),)
    return NetworkPicture(text, text, (node,), (), (), load, (finding,), text, differing, (text,))


def menus(text: str) -> None:
    """What the prompt offers, of an alias that a project's file describes."""
    session = Conversation(Output(io.StringIO(), io.StringIO()))
    session.aliases = {"zz": text}
    (offered,) = LineCompleter(session).get_completions(Document("zz"), CompleteEvent())
    assert steers(offered.text + offered.display_text + offered.display_meta_text) == ""


def eds_lines(text: str) -> None:
    """An EDS that is made of a device: names and descriptions are values of their keys, each on its line."""
    entry = OdEntry(0x2000, 0, text, BY_SHORT_NAME["vs"])
    described = ObjectDictionary({0x2000: OdObject(0x2000, text, ObjectType.VAR, {0: entry})})
    written = eds_text(described, "a.eds", text, None)
    assert steers(written.replace("\n", "")) == ""
    entry = OdEntry(0x2000, 0, "x", BY_SHORT_NAME["vs"])
    described = ObjectDictionary({0x2000: OdObject(0x2000, "x", ObjectType.VAR, {0: entry})})
    plain = eds_text(described, "a.eds", "x", None)
    assert written.count("\n") == plain.count("\n")
    assert re.findall(r"^\[.*$", written, re.MULTILINE) == re.findall(r"^\[.*$", plain, re.MULTILINE)


_DCF_OF = """[FileInfo]
FileName=a.eds
[DeviceInfo]
VendorName=a
[MandatoryObjects]
SupportedObjects=1
1=0x2000
[2000]
ParameterName=Name
ObjectType=7
DataType=9
AccessType=rw
"""


def dcf(text: str) -> None:
    """A DCF of a device: the text that an object holds, and the name of the file that describes it."""
    plain, hostile = (
        write_dcf(
            _DCF_OF.encode(), source, {(0x2000, 0): held}, Commissioned(source, 1, datetime(2026, 1, 2, 3, 4))
        ).data.decode("utf-8-sig")
        for source, held in (("x", b"x"), (text, text.encode("utf-8", "replace")))
    )
    assert steers(hostile.replace("\n", "")) == ""
    assert re.findall(r"^\[.*$", hostile, re.MULTILINE) == re.findall(r"^\[.*$", plain, re.MULTILINE)
    assert hostile.count("\n") in (plain.count("\n"), plain.count("\n") - 1), "a value that it cannot say is left out"


def nodelist(text: str) -> None:
    """Lines of its keys, and nothing else."""
    plain, hostile = (nodelist_text(Nodelist(name, (ListedNode(1, name, "node1.dcf"),), name)) for name in ("x", text))
    assert steers(hostile.replace("\n", "")) == ""
    keys = r"^[^=\n]*(?:=|$)"
    assert re.findall(keys, hostile, re.MULTILINE) == re.findall(keys, plain, re.MULTILINE)


def places(text: str) -> None:
    """Files that are named after a stranger's file, a bus or a device: none is elsewhere, and no name steers."""
    bus, folder = text.encode("utf-8", "replace").decode(), Path("/kept")
    identity = {"vendor": 1, "product": 2, "revision": 3, "serial": None}
    kept = (
        stored_place((1, 2, 3), text), ChangeHistory(folder, bus).path(1, identity), JournalFolder(folder, bus).path(1),
        folder / f"{file_name(bus)}.count",
    )  # fmt: skip
    for place in kept:
        assert steers(str(place)) == ""
    assert kept[0].parent == library_folder()
    assert all(place.parent == folder for place in kept[1:])
    with suppress(UsageError):
        refuse_name(text)
        assert re.fullmatch(r"[a-z0-9_-]+", text)


SINKS: dict[str, Callable[[str], None]] = {
    sink.__name__: sink for sink in (terminal, wrapped, messages, completion, csv_cells, pages, junit, dbc, toml, names,
    annotations, sarif, report_page, graph, menus, eds_lines, dcf, nodelist, places)
}  # fmt: skip


@pytest.mark.parametrize("sink", SINKS)
def test_no_sink_shows_what_a_stranger_steers_with(sink: str) -> None:
    for text in HOSTILE:
        SINKS[sink](text)


@pytest.mark.hypothesis
@given(st.text(max_size=40) | st.lists(st.sampled_from(HOSTILE), max_size=3).map("".join), st.sampled_from([*SINKS]))
@example("\x1b]0;x\x07", "terminal")
def test_whatever_the_text_no_sink_is_steered(text: str, sink: str) -> None:
    SINKS[sink](text)
