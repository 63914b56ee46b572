"""README and the documentation are true: their screens are what commands print, their tables are what the code has.

`pytest tests/documentation --update-transcripts` rewrites the sessions; `python -m tests.documentation.reference`
rewrites pictures and what is generated.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import pytest

import dvtcli
from dvtcli import errors, results, testing
from dvtcli.simulator.network.family_file import family_names, load_family
from tests.console import commands, compare, rewritten, workplace
from tests.documentation.pages import BUILT, CONSOLE, DOCS, PAGES, anchors, first_column, links, section, text
from tests.documentation.reference import REWRITE, pages
from tests.documentation.reference.sample_report import SAMPLE, sample_report
from tests.documentation.reference.screens import PICTURES, picture, pictured
from tests.house.source import PACKAGE
from tests.process import ROOT, SCRIPTS

every_page = pytest.mark.parametrize("page", PAGES)
with_sessions = pytest.mark.parametrize("page", [page for page in PAGES if CONSOLE.search(text(page))])


@pytest.mark.drawn(12)
@with_sessions
def test_sessions_print_what_they_show(page: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    folder = workplace(tmp_path)
    blocks = [block.splitlines() for block in CONSOLE.findall(text(page))]
    if request.config.getoption("--update-transcripts"):
        fresh = iter(["\n".join(["```console", *rewritten(block, folder), "```"]) for block in blocks])
        (ROOT / page).write_text(CONSOLE.sub(lambda _: next(fresh), text(page)), encoding="utf-8")
        return
    for block in blocks:
        assert commands(block)
        compare(block, folder)


def test_pictures_of_terminals_are_the_golden_screens() -> None:
    shown = pictured(pages())
    assert set(shown) == set(PICTURES.iterdir()), REWRITE
    for path, name in shown.items():
        assert path.read_text("utf-8") == picture(name), f"{path.name} is not {name}: {REWRITE}"


def test_the_sample_report_is_what_report_writes() -> None:
    assert SAMPLE.read_text("utf-8") == sample_report(), REWRITE


def test_there_are_sessions_and_pictures() -> None:
    assert sum(len(CONSOLE.findall(text(page))) for page in PAGES) >= 11
    assert {Path(name).stem.rpartition("_")[0] for name in pictured(pages()).values()} >= {"menu", "tour", "table"}


@every_page
def test_screens_fit_a_page(page: str) -> None:
    for block in CONSOLE.findall(text(page)):
        for line in block.splitlines():
            assert len(line) <= 140 or line.startswith(("{", "  hint ")), line  # a hint is copied, so it is one line


@every_page
def test_links_lead_somewhere(page: str) -> None:
    for path, anchor in links(page):
        assert path.is_file(), f"{page} links to {path}"
        assert path not in BUILT, f"{page} links to {path}, which a checkout does not have"
        assert not anchor or anchor in anchors(path), f"{page} links to {path.name}#{anchor}"


@every_page
def test_a_page_begins_with_its_title(page: str) -> None:
    assert text(page).startswith("# ")


def test_every_page_is_in_the_menu() -> None:
    named = set(re.findall(r"\s([\w/-]+\.md)$", (ROOT / "mkdocs.yml").read_text("utf-8"), re.M))
    assert named == {path.relative_to(DOCS).as_posix() for path in {*DOCS.rglob("*.md"), *BUILT}}


def test_exit_codes_are_those_of_the_errors() -> None:
    kinds = (kind for _, kind in inspect.getmembers(errors, inspect.isclass) if issubclass(kind, errors.DvtcliError))
    used = {kind.exit_code for kind in kinds}
    rows = re.findall(r"^\| ([\d, ]+) \|", section("docs/reference/exit-codes.md", "By number"), re.M)
    assert {int(code) for row in rows for code in row.split(",")} == {0, 3, *used, 129, 130, 143}


def test_every_reason_for_a_refusal_is_told() -> None:
    (row,) = re.findall(r"^\| 6 \|.*$", section("docs/reference/exit-codes.md", "By number"), re.M)
    for reason in ("another device", "nobody can answer", "another dvtcli", "recover"):
        assert reason in row


def test_every_script_is_listed_with_how_it_is_run() -> None:
    table = section("docs/how-to/scripts.md", "Scripts to learn from")
    scripts = {path.name for path in SCRIPTS.iterdir() if path.suffix in (".dvt", ".tcl")}
    assert {cell.strip("`") for cell in first_column(table)} == scripts
    for line in table.splitlines():
        if line.startswith("| `"):
            name, _, how = (cell.strip(" `") for cell in line.strip("|").split("|"))
            assert f"dvtcli {how} run scripts/{name}" in (SCRIPTS / name).read_text("utf-8"), name


@pytest.mark.parametrize("name", family_names())
def test_every_simulated_family_says_what_it_is_like(name: str) -> None:
    assert load_family(name).about, f"families/{name}/simulated.toml: about = …, in a few words"


def test_every_room_is_described() -> None:
    rooms = {path.name for path in PACKAGE.iterdir() if path.is_dir() and path.name != "__pycache__"} | {"errors.py"}
    what_lives_there = text("docs/explanation/architecture.md").partition("| room | imports |")[0]
    assert {cell.strip("`/") for cell in first_column(what_lives_there)} == rooms


#: what a name before a point stands for in the documentation's prose
HOLDERS = {
    "dvtcli": dvtcli, "bus": dvtcli.Bus, "node": dvtcli.Node, "bus.lss": dvtcli.Lss, "Bus": dvtcli.Bus,
    "Node": dvtcli.Node, "Lss": dvtcli.Lss, "errors": errors, "results": results, "testing": testing,
    "dvtcli.errors": errors, "dvtcli.results": results, "dvtcli.testing": testing, "ServedBus": testing.ServedBus,
}  # fmt: skip


@every_page
def test_names_of_the_python_api_in_prose_are_there(page: str) -> None:
    prose = re.sub(r"^```.*?^```$", "", text(page), flags=re.M | re.S)
    named = re.findall(r"`(?:with |await )?((?:\w+\.)*\w+)\.(\w+)(?![\w.-]*[/:])[^`]*`", prose)
    assert [f"{holder}.{name}" for holder, name in named if holder in HOLDERS and not _has(HOLDERS[holder], name)] == []


def _has(holder: object, name: str) -> bool:
    return hasattr(holder, name) or name in getattr(holder, "__annotations__", {}) or name in OTHERS


#: endings of files, the group of transports, and the collection of Ansible
OTHERS = {"canopen", "yaml", "dcf", "eds", "toml", "log", "html", "json", "jsonl", "dvt", "py", "md", "bus"}
