"""Lines, headers and encodings."""

from __future__ import annotations

import pytest

from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.ini import section_values, split_sections

TEXT = "[DeviceInfo]\nVendorName=Größe\n\n[1000]\nParameterName=Device type\n"


@pytest.mark.parametrize(
    ("encoding", "named"),
    [
        ("utf-8", "utf-8"),
        ("utf-8-sig", "utf-8-sig"),
        ("cp1252", "cp1252"),
        ("utf-16", "utf-16"),
    ],
)
def test_encodings(encoding: str, named: str) -> None:
    text = split_sections(TEXT.encode(encoding))
    assert (text.encoding, [section.name for section in text.sections]) == (named, ["DeviceInfo", "1000"])
    assert section_values([text.sections[0]], Findings())["vendorname"].value == "Größe"


def test_big_endian_utf16() -> None:
    assert len(split_sections(b"\xfe\xff" + TEXT.encode("utf-16-be")).sections) == 2


def test_bytes_that_windows_1252_leaves_undefined() -> None:
    text = split_sections(b"[1000]\nParameterName=\x81\xb5\n")
    assert text.encoding == "latin-1"
    assert section_values(text.sections, Findings())["parametername"].value == "\x81µ"


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_line_ends_and_line_numbers(newline: str) -> None:
    text = split_sections(TEXT.replace("\n", newline).encode())
    assert text.newline == newline
    assert [section.line for section in text.sections] == [1, 4]
    assert section_values([text.sections[1]], Findings())["parametername"].line == 5


def test_unusual_separators_do_not_count_as_lines() -> None:
    text = split_sections("[1000]\nParameterName=a\x0bb\x85c\u2028d\n[1001]\n".encode())
    assert [section.line for section in text.sections] == [1, 3]


def test_blanks_around_everything() -> None:
    text = split_sections(b"\n  \t[ 1000 ]  ; the type\n  ParameterName \t=  Device  type \t\n")
    findings = Findings()
    assert [(section.name, section.line) for section in text.sections] == [("1000", 2)]
    assert section_values(text.sections, findings)["parametername"][:3] == ("ParameterName", "Device  type", 3)
    assert not findings.found


def test_comments_are_no_findings_and_a_value_may_hold_an_equals_sign() -> None:
    text = split_sections(b"; head\n# head\n[1000]\n;ParameterName=no\n#x\nParameterName=a=b;c\n")
    findings = Findings()
    assert section_values([text.preamble, *text.sections], findings)["parametername"].value == "a=b;c"
    assert not findings.found


@pytest.mark.parametrize(
    ("data", "line", "rule"),
    [
        (b"noise\n[1000]\n", 1, "bad-line"),
        (b"[1000]\nnoise\n", 2, "bad-line"),
        (b"[1000]\n=5\n", 2, "bad-line"),
        (b"[1000]\nA=1\nb=2\na=3\n", 4, "duplicate-key"),
        (b"\n[1000\nA=1\n", 2, "bad-header"),
        (b"[1000] noise\nA=1\n", 1, "bad-header"),
    ],
)
def test_malformed_lines_are_reported(data: bytes, line: int, rule: str) -> None:
    text = split_sections(data)
    findings = Findings()
    section_values([text.preamble, *text.sections], findings)
    assert [(finding.line, finding.rule) for finding in findings.found] == [(line, rule)]


def test_the_last_of_two_equal_keys_counts() -> None:
    values = section_values(split_sections(b"[1000]\nDefaultValue=1\ndefaultvalue=2\n").sections, Findings())
    assert values["defaultvalue"][:3] == ("defaultvalue", "2", 3)
