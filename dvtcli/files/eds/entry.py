"""Read a sub-index of an EDS or DCF: the keys of its section become an `OdEntry`.

Reads the keys of CiA 306, 4.6.3, and the common private keys `Unit` and `Factor`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from dvtcli.domain.datatypes import DATA_TYPES, U8, DataType, Kind
from dvtcli.domain.object_dictionary import Access, OdEntry
from dvtcli.domain.standard_objects import standard_entry
from dvtcli.files.eds.findings import (
    ACCESS_TYPE,
    BAD_VALUE,
    EMPTY_VALUE,
    IMPLIED_DATA_TYPE,
    LEADING_ZERO,
    LIMIT_TYPE,
    LIMIT_WITHOUT_SENSE,
    LIMITS_CROSSED,
    LIMITS_WRAPPED,
    NO_DATA_TYPE,
    NO_NAME,
    ODD_VALUE,
    UNKNOWN_DATA_TYPE,
    UNTYPED_VALUE,
    VALUE_TWICE,
    Findings,
)
from dvtcli.files.eds.ini import IniValue, Values
from dvtcli.files.eds.numbers import (
    EncodedValue,
    above_type,
    encode_value,
    is_hexadecimal,
    leading_zero_in,
    number_key,
    octal_in,
    quoted,
    read_limit,
    read_number,
    text_key,
    without_comment,
)

_ACCESS = {access.value: access for access in Access}
_ALMOST_ACCESS = {"r": Access.RO, "w": Access.WO, "wr": Access.RW}
_DOMAIN = DATA_TYPES[0x0F]


@dataclass(frozen=True, slots=True)
class EntryPlace:
    """The place of an entry: *line* of its section; *of_many*: in an ARRAY or RECORD; *domain*: by its ObjectType."""

    index: int
    sub_index: int
    line: int
    of_many: bool
    domain: bool = False

    @property
    def shown(self) -> str:
        """The object as named in findings."""
        return f"{self.index:04X}:{self.sub_index:02X}" if self.of_many else f"{self.index:04X}"


class _Limits(NamedTuple):
    low: int | float | None = None
    low_relative: bool = False
    high: int | float | None = None
    high_relative: bool = False


def read_entry(values: Values, place: EntryPlace, findings: Findings) -> OdEntry:
    """Turn a section's *values* into an entry; whatever is missing or malformed is reported and left unknown."""
    data_type = _data_type(values, place, findings)
    default = read_value(values.get("defaultvalue"), data_type, findings)
    value = read_value(values.get("parametervalue"), data_type, findings, is_wanted=True)
    limits = _limits(values, data_type, findings)
    return OdEntry(
        index=place.index,
        sub_index=place.sub_index,
        name=_name(values, place, findings),
        data_type=data_type,
        access=_access(values, place, findings),
        pdo_mapping=_pdo_mapping(values, findings),
        default=None if default is None else default.data,
        default_relative=default is not None and default.relative,
        value=None if value is None else value.data,
        value_relative=value is not None and value.relative,
        low=limits.low,
        high=limits.high,
        unit=text_key(values, "unit"),
        object_flags=number_key(values, "objflags", 0, 0xFFFF_FFFF, findings) or 0,
        line=place.line,
        low_relative=limits.low_relative,
        high_relative=limits.high_relative,
        denotation=text_key(values, "denotation"),
        unknown_type=_unknown_type(values),
        factor=text_key(values, "factor")[:40],
    )


def read_value(
    given: IniValue | None, data_type: DataType | None, findings: Findings, *, is_wanted: bool = False
) -> EncodedValue | None:
    """Encode a DefaultValue, or a ParameterValue if *is_wanted*.

    Returns None if the value is absent, empty or malformed; reports the last two.
    """
    if given is None:
        return None
    if is_wanted:
        _tell_other(given, data_type, findings)
    if not given.value:
        findings.add(EMPTY_VALUE, given.line, given.key)
        return None
    if data_type is None:
        text = f"{quoted(given)} cannot be read: its data type is unknown"
        findings.add(UNTYPED_VALUE, given.line, text, value_unread=is_wanted)
        return None
    try:
        encoded = encode_value(data_type, given.value)
    except ValueError as error:
        text = f"{quoted(given)} is not a valid {data_type.name}: {error}"
        findings.add(BAD_VALUE, given.line, text if is_wanted else f"{text}; ignored", value_lost=is_wanted)
        return None
    if encoded.remark:
        rule = LEADING_ZERO if octal_in(given.value) else ODD_VALUE
        findings.add(rule, given.line, f"{given.key}: {encoded.remark}")
    return encoded


def _tell_other(given: IniValue, data_type: DataType | None, findings: Findings) -> None:
    """Report an error if an earlier line has another value: readers differ in their choice."""
    other = given.other
    while other is not None:
        if not _means_same(given.value, other.value, data_type):
            text = f"{quoted(given)}, but {quoted(other)} in line {other.line}: it is unknown which is right"
            findings.add(VALUE_TWICE, given.line, text, value_lost=True)
            return
        other = other.other


def _means_same(one: str, other: str, data_type: DataType | None) -> bool:
    if data_type is None:
        return one == other
    try:
        first, second = encode_value(data_type, one), encode_value(data_type, other)
    except ValueError:
        return False
    return (first.data, first.relative) == (second.data, second.relative)


def _name(values: Values, place: EntryPlace, findings: Findings) -> str:
    given = values.get("parametername")
    if given is None:
        findings.add(NO_NAME, place.line, "no ParameterName")
    elif not given.value:
        findings.add(EMPTY_VALUE, given.line, given.key)
    return given.value if given is not None and given.value else place.shown


def _data_type(values: Values, place: EntryPlace, findings: Findings) -> DataType | None:
    code = number_key(values, "datatype", 0, 0xFFFF, findings)
    if code in DATA_TYPES:
        return DATA_TYPES[code]
    if code is not None:
        line = values["datatype"].line
        findings.add(UNKNOWN_DATA_TYPE, line, f"data type 0x{code:04X} is not known, nor its length")
        return None
    return _implied_data_type(place, findings)


def _unknown_type(values: Values) -> int | None:
    """Return the code of an unknown data type, already reported by `_data_type`."""
    code = number_key(values, "datatype", 0, 0xFFFF, Findings())
    return None if code in DATA_TYPES else code


def _implied_data_type(place: EntryPlace, findings: Findings) -> DataType | None:
    """Return the data type by the standards for an entry without DataType."""
    standard = standard_entry(place.index, place.sub_index)
    implied, source = (None, "") if standard is None else (standard.data_type, "CiA 301")
    if implied is None and place.of_many and place.sub_index == 0:
        implied, source = U8, "CiA 301: highest sub-index"
    if place.domain:
        implied, source = _DOMAIN, "ObjectType DOMAIN"
    if implied is None:
        findings.add(NO_DATA_TYPE, place.line, "no DataType: its length is not known")
    else:
        findings.add(IMPLIED_DATA_TYPE, place.line, f"no DataType: taken as {implied.name} ({source})")
    return implied


def _access(values: Values, place: EntryPlace, findings: Findings) -> Access:
    given = values.get("accesstype")
    text = "" if given is None else without_comment(given.value).lower()
    if text in _ACCESS:
        return _ACCESS[text]
    line = place.line if given is None else given.line
    said = f"AccessType={text} is not known" if text else "no AccessType"
    if text in _ALMOST_ACCESS:
        findings.add(ACCESS_TYPE, line, f"{said}: taken as {_ALMOST_ACCESS[text].value}")
        return _ALMOST_ACCESS[text]
    standard = standard_entry(place.index, place.sub_index)
    access, source = Access.RW, ""
    if standard is not None and standard.access is not None:
        access, source = standard.access, " (CiA 301)"
    findings.add(ACCESS_TYPE, line, f"{said}: taken as {access.value}{source}")
    return access


def _pdo_mapping(values: Values, findings: Findings) -> bool | None:
    number = number_key(values, "pdomapping", 0, 1, findings)
    return None if number is None else bool(number)


def _limits(values: Values, data_type: DataType | None, findings: Findings) -> _Limits:
    low, low_relative = _limit(values.get("lowlimit"), data_type, findings)
    high, high_relative = _limit(values.get("highlimit"), data_type, findings)
    if low is not None and high is not None and low > high and low_relative == high_relative:
        text = f"{quoted(values['lowlimit'])} and {quoted(values['highlimit'])} mean {low}..{high}: both ignored"
        rule = LIMITS_CROSSED if _crossed_as_written(values["lowlimit"], values["highlimit"]) else LIMITS_WRAPPED
        findings.add(rule, values["highlimit"].line, text)
        return _Limits()
    if high is not None and _bounds_nothing(values["highlimit"], data_type, high, low, findings):
        high, high_relative = None, False
    if low is not None and _bounds_nothing(values["lowlimit"], data_type, low, low, findings):
        low, low_relative = None, False
    return _Limits(low, low_relative, high, high_relative)


def _bounds_nothing(
    given: IniValue, data_type: DataType | None, limit: float, low: float | None, findings: Findings
) -> bool:
    """Report *given*, and return True, if the limit exceeds a signed *data_type* and means no negative number.

    Example: 32768 bounds no INTEGER16. But 0x8000 means -32768 as LowLimit, and a negative number as HighLimit if *low*
    is below.
    """
    if data_type is None or data_type.kind is not Kind.INTEGER or not (why := above_type(data_type, given.value)):
        return False
    if is_hexadecimal(given.value) and low is not None and (limit > low or given.key.lower() == "lowlimit"):
        return False
    findings.add(LIMIT_TYPE, given.line, f"{quoted(given)} {why}: it bounds nothing; ignored")
    return True


def _crossed_as_written(low: IniValue, high: IniValue) -> bool:
    """Whether the limits are the wrong way round before the data type makes negative numbers of them."""
    try:
        return read_number(low.value) > read_number(high.value)
    except ValueError:  # $NODEID or a REAL: no number of those is taken for a negative one
        return True


def _limit(given: IniValue | None, data_type: DataType | None, findings: Findings) -> tuple[int | float | None, bool]:
    """Read a limit; empty equals absent (CiA 306, 4.6.3)."""
    if given is None or not given.value or data_type is None or not without_comment(given.value):
        return None, False
    if data_type.kind not in (Kind.BOOLEAN, Kind.INTEGER, Kind.UNSIGNED, Kind.REAL):
        findings.add(LIMIT_WITHOUT_SENSE, given.line, f"{quoted(given)}: a {data_type.name} has no limits; ignored")
        return None, False
    try:
        limit = read_limit(data_type, given.value)
    except ValueError as error:
        findings.add(LIMIT_TYPE, given.line, f"{quoted(given)} is not a valid {data_type.name}: {error}; ignored")
        return None, False
    if data_type.kind is not Kind.REAL and (remark := leading_zero_in(given.value)):
        findings.add(LEADING_ZERO if octal_in(given.value) else ODD_VALUE, given.line, f"{given.key}: {remark}")
    return limit
