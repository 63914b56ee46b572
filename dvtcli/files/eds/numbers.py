"""Read and write numbers, typed values and limits as text of EDS, DCF and XDD files (CiA 306, 4.2)."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

from dvtcli.domain.datatypes import DataType, Kind, parse_number
from dvtcli.files.eds.findings import BAD_NUMBER, LEADING_ZERO, ODD_VALUE, Findings
from dvtcli.files.eds.ini import IniValue, Values

_NODE_ID = re.compile(r"\$(?:NODE_?ID|(MY_NODE_?ID))", re.IGNORECASE)
_LONGEST_NUMBER = 40
# A file repeats few numbers many times: remembering them halves the time for a whole file.
_REMEMBERED = 4096
_TEXT_KINDS = (Kind.VISIBLE_STRING, Kind.UNICODE_STRING)


class EncodedValue(NamedTuple):
    """A value's bytes for node-ID 0; *relative*: the node-ID is added. *remark* is empty or an oddity."""

    data: bytes
    relative: bool = False
    remark: str = ""


def without_comment(text: str) -> str:
    """Return *text* up to a `;`; not for text values."""
    return text.partition(";")[0].strip() if ";" in text else text


@lru_cache(maxsize=_REMEMBERED)
def read_number(text: str) -> int:
    """Read a whole number: `16`, `0x10` and `020` are the same (CiA 306 writes octal with a leading 0).

    Raises ValueError if malformed; `08` is no octal number and means 8.
    """
    text = without_comment(text).removeprefix("+")
    digits = text.removeprefix("-")
    if len(digits) > 1 and digits[0] == "0" and len(digits) <= _LONGEST_NUMBER and _is_octal(digits):
        return int(text, 8)
    return parse_number(text)


@lru_cache(maxsize=_REMEMBERED)
def leading_zero_remark(text: str) -> str:
    """Return a remark on a leading 0 of *text*; empty if all readers get the same number."""
    digits = without_comment(text).lstrip("+-")
    if len(digits) < 2 or digits[0] != "0" or not digits.isdecimal() or len(digits) > _LONGEST_NUMBER:
        return ""
    if not _is_octal(digits):
        return f"{digits} has a leading 0 but is not octal; taken as {int(digits)}"
    octal = int(digits, 8)
    return f"{digits} is octal (leading 0): {octal}, not {int(digits)}" if octal != int(digits) else ""


def octal_in(text: str) -> bool:
    """Whether a leading 0 changes the number of *text* or a term (`$NODEID+0200`)."""
    return any(leading_zero_remark(term) and _is_octal(term.lstrip("-")) for term in _terms(text))


def leading_zero_in(text: str) -> str:
    """Return a remark on a leading 0 of *text* or a term; empty for none."""
    return next(filter(None, map(leading_zero_remark, _terms(text))), "")


def _terms(text: str) -> list[str]:
    return [term.strip() for term in without_comment(text).split("+")]


def _is_octal(digits: str) -> bool:
    return all(digit in "01234567" for digit in digits)


def encode_value(data_type: DataType, text: str) -> EncodedValue:
    """Encode a non-empty DefaultValue or ParameterValue. Raises ValueError if unfit for *data_type*."""
    if data_type.kind in _TEXT_KINDS:
        return EncodedValue(_encode_text(data_type, text))
    text = without_comment(text)
    if data_type.kind is Kind.REAL:
        return EncodedValue(_encode_real(data_type, text))
    if data_type.kind is Kind.OCTETS:
        return EncodedValue(_encode_octets(text))
    if data_type.kind is Kind.TIME and ":" in text:
        return EncodedValue(data_type.parse(text))
    return _encode_integer(data_type, text)


@lru_cache(maxsize=_REMEMBERED)
def read_limit(data_type: DataType, text: str) -> tuple[int | float, bool]:
    """Read a LowLimit or HighLimit in the object's own type, and whether the node-ID is added. Raises ValueError."""
    text = without_comment(text)
    if data_type.kind is Kind.REAL:
        (limit,) = struct.unpack("<f" if data_type.bits == 32 else "<d", _encode_real(data_type, text))
        if not math.isfinite(limit):
            raise ValueError(f"{text} is not a finite number")
        return float(limit), False
    if data_type.limits is None:
        raise ValueError(f"a {data_type.name} has no limits")
    number, relative, _ = _sum_of_terms(text)
    return _in_range(data_type, number), relative


def _encode_text(data_type: DataType, text: str) -> bytes:
    try:
        return data_type.encode(text)
    except UnicodeEncodeError:
        raise ValueError(f"not a {data_type.name}") from None


def _encode_real(data_type: DataType, text: str) -> bytes:
    if text[:2].lower() == "0x":
        try:
            return parse_number(text).to_bytes(data_type.size or 0, "little")
        except OverflowError:
            raise ValueError(f"more than the {data_type.bits} bits of a {data_type.name}") from None
    if "_" in text:
        raise ValueError("not a number")
    return data_type.encode(float(text))


def _encode_octets(text: str) -> bytes:
    digits = text[2:] if text[:2].lower() == "0x" else text
    # `0x0` is what many tools write for nothing or one zero byte; without the prefix an odd count is a mistake.
    if len(digits) % 2 and digits is not text:
        digits = "0" + digits
    try:
        return bytes.fromhex(digits)
    except ValueError:
        raise ValueError("not a string of hexadecimal bytes") from None


@lru_cache(maxsize=_REMEMBERED)
def _encode_integer(data_type: DataType, text: str) -> EncodedValue:
    if data_type.kind is Kind.BOOLEAN and text.lower() in ("true", "false"):
        return EncodedValue(data_type.encode(text.lower() == "true"))
    number, relative, remark = _sum_of_terms(text)
    if data_type.kind is Kind.TIME:
        if not 0 <= number < 1 << 48:
            raise ValueError(f"more than the 48 bits of a {data_type.name}")
        return EncodedValue(number.to_bytes(6, "little"), relative, remark)
    meant = _in_range(data_type, number)
    if meant != number and not is_hexadecimal(text):
        remark = f"{number} is beyond {data_type.name} ({_range(data_type)}); taken as {meant}, the same bits"
    return EncodedValue(data_type.encode(meant), relative, remark)


def is_hexadecimal(text: str) -> bool:
    """Whether *text* writes bits (`0xFFFE`), as which a negative number may be written."""
    return "0x" in text.lower()


def above_type(data_type: DataType, text: str) -> str:
    """Return a remark if the limit *text* exceeds a signed *data_type*; empty otherwise."""
    low, high = data_type.limits or (0, 0)
    number, relative, _ = _sum_of_terms(without_comment(text)) if isinstance(high, int) and low < 0 else (0, False, "")
    if relative or number <= high:
        return ""
    return f"does not fit {data_type.name} ({_range(data_type)})"


def _range(data_type: DataType) -> str:
    low, high = data_type.limits or (0, 0)
    return f"{low}..{high}"


def _in_range(data_type: DataType, number: int) -> int:
    """Convert *number*, if a signed type's bits were written as unsigned.

    Some tools write 32 or 64 bits for all types: 0xFFFFFFFE is -2 for an INTEGER8 too.
    """
    low, high = data_type.limits or (0, 0)
    if low < 0 and number > high:
        for bits in (data_type.bits or 0, 32, 64):
            if low <= number - (1 << bits) < 0:
                return number - (1 << bits)
    if not low <= number <= high:
        raise ValueError(f"does not fit {data_type.name} ({_range(data_type)})")
    return number


def _sum_of_terms(text: str) -> tuple[int, bool, str]:
    """Add up `$NODEID+0x180`, `0x180+$NODEID`, `$NODEID` or a plain number; at most one term is the node-ID."""
    if "$" not in text:
        return read_number(text), False, leading_zero_remark(text)
    number, relative, remark = 0, False, ""
    for part in text.split("+"):
        term = part.strip()
        node_id = _NODE_ID.fullmatch(term)
        if node_id is None:
            number += read_number(term)
            remark = remark or leading_zero_remark(term)
        elif relative:
            raise ValueError("names the node-ID twice")
        else:
            relative = True
            remark = remark or (f"{term} is not the standard's $NODEID; taken for it" if node_id[1] else "")
    if not relative:
        raise ValueError("not understood")
    return number, True, remark


_SHOWN = 60


def quoted(value: IniValue) -> str:
    """Return `key=value` for a finding, with long values cut."""
    text = value.value if len(value.value) <= _SHOWN else value.value[:_SHOWN] + "…"
    return f"{value.key}={text}"


def text_key(values: Values, key: str) -> str:
    """Return the text of *key* (in lower case), empty if absent."""
    found = values.get(key)
    return "" if found is None else found.value


def number_key(values: Values, key: str, low: int, high: int, findings: Findings) -> int | None:
    """Return the number of *key* (in lower case), *low*..*high*; None if absent, empty or malformed (reported)."""
    found = values.get(key)
    if found is None:
        return None
    text = without_comment(found.value)
    if not text:
        return None
    try:
        number = read_number(text)
    except ValueError:
        findings.add(BAD_NUMBER, found.line, f"{quoted(found)} is not a number; ignored")
        return None
    if not low <= number <= high:
        findings.add(BAD_NUMBER, found.line, f"{quoted(found)} is not within {low}..{high}; ignored")
        return None
    if remark := leading_zero_remark(text):
        findings.add(LEADING_ZERO if octal_in(text) else ODD_VALUE, found.line, f"{found.key}: {remark}")
    return number


_NODE_ID_TEXT = "$NODEID"
#: Below this every whole number is a REAL64 of its own.
_ALL_WHOLE = 1 << 53
_NUMBER_KINDS = (Kind.BOOLEAN, Kind.INTEGER, Kind.UNSIGNED)


def is_text(data_type: DataType | None) -> bool:
    """Whether values of this type are text, so that `;` begins no comment."""
    return data_type is not None and data_type.kind in _TEXT_KINDS


def same_value(data_type: DataType | None, one: bytes | None, other: bytes | None) -> bool:
    """Whether both values are equal, apart from zeros after a text, and the byte that means true."""
    if one == other or one is None or other is None or data_type is None:
        return one == other
    if data_type.kind not in (*_TEXT_KINDS, Kind.BOOLEAN) or (data_type.size or len(one)) != len(one):
        return False
    return len(other) == (data_type.size or len(other)) and data_type.decode(one) == data_type.decode(other)


def written_value(data_type: DataType | None, data: bytes, *, relative: bool) -> str | None:
    """Return *data* as text, with `$NODEID+` if *relative*; None if no text of one line represents it."""
    return text_of(data_type, data, hexadecimal=True, exact=True, relative=relative)


def text_of(
    data_type: DataType | None, data: bytes, *, hexadecimal: bool, exact: bool, relative: bool = False
) -> str | None:
    """Return the preferred one-line text for *data*, None if there is none.

    Numbers are *hexadecimal* if possible. *exact*: every byte reads back, characters are printable, negative numbers
    have a sign, a REAL has all digits; otherwise the value is equal, and a REAL is as short as possible. *relative*
    adds `$NODEID+`.
    """
    if data_type is None:
        return None
    for text in _candidates(data_type, data, hexadecimal=hexadecimal, exact=exact):
        said = f"{_NODE_ID_TEXT}+{text}" if relative else text
        if _means(data_type, said, EncodedValue(data, relative), exact=exact):
            return said
    return None


def written_limit(limit: int | float, *, relative: bool) -> str:
    """Return a limit as text, with `$NODEID+` if *relative*."""
    text = _number(limit) if isinstance(limit, int) else next(_exact_reals(limit))
    return f"{_NODE_ID_TEXT}+{text}" if relative else text


def _number(number: int) -> str:
    return f"0x{number:X}" if number >= 0 else str(number)


def _candidates(data_type: DataType, data: bytes, *, hexadecimal: bool, exact: bool) -> Iterator[str]:
    """Iterate over texts that may represent *data*, preferred first."""
    if data_type.kind is Kind.OCTETS:
        yield data.hex().upper() or "0x"
        return
    try:
        value = data_type.decode(data)
    except ValueError:
        value = None  # of another length than its type
    if data_type.kind in _TEXT_KINDS:
        yield from () if value is None else [str(value)]
        return
    if isinstance(value, float):
        yield from _exact_reals(value) if exact else _reals(value)
    decimal = [str(int(value))] if isinstance(value, int) and data_type.kind in _NUMBER_KINDS else []
    if not hexadecimal or (exact and isinstance(value, int) and value < 0):
        yield from decimal
    yield f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X}"
    yield from decimal


def _exact_reals(value: float) -> Iterator[str]:
    """Iterate over texts with all digits, without a point if possible: dcfgen reads no REAL that has one."""
    if value.is_integer() and abs(value) < _ALL_WHOLE and math.copysign(1, value) == math.copysign(1, int(value)):
        yield str(int(value))
    yield repr(value)


def _reals(value: float) -> Iterator[str]:
    if math.isfinite(value):
        yield from (f"{value:.7g}", f"{value:.9g}", repr(value))


def _means(data_type: DataType, text: str, wanted: EncodedValue, *, exact: bool) -> bool:
    if not text or text != text.strip() or not all(char.isprintable() if exact else char >= " " for char in text):
        return False
    try:
        found = encode_value(data_type, text)
    except ValueError:
        return False
    is_same = found.data == wanted.data if exact else same_value(data_type, found.data, wanted.data)
    return is_same and found.relative == wanted.relative
