"""Rules about what makes a file a DCF: DeviceComissioning, and values that are set."""

from __future__ import annotations

from dvtcli.domain.lint.lint_rule import NOTE, WARNING, check
from dvtcli.files.eds.keys import quoted
from dvtcli.files.eds.lint.linted_text import Found, LintedText, given
from dvtcli.files.eds.numbers import read_number, without_comment

_SOURCE = "CiA 306, 5"
_SECTION = "devicecomissioning"
_RATES = (10, 20, 50, 125, 250, 500, 800, 1000)


@check("parameter-value-in-eds", WARNING, "an EDS sets values (ParameterValue)", f"{_SOURCE}: ParameterValue")
def parameter_value_in_eds(text: LintedText) -> Found:
    """It describes one device and not all of its kind; tools that read an EDS pass it by."""
    if text.is_eds:
        for entry in text.objects:
            value = given(entry.values, "parametervalue")
            if value is not None:
                yield value.line, f"{quoted(value)} is a DCF's: in an EDS it counts for some tools only"


@check("commissioning-in-eds", WARNING, "an EDS has DeviceComissioning", f"{_SOURCE}: DeviceComissioning")
def commissioning_in_eds(text: LintedText) -> Found:
    """A node-ID belongs to a DCF."""
    section = text.section(_SECTION)
    if text.is_eds and section is not None:
        yield section.line, f"[{section.name}] belongs to a DCF"


@check("no-commissioning", NOTE, "a DCF without NodeID in DeviceComissioning", f"{_SOURCE}: DeviceComissioning")
def no_commissioning(text: LintedText) -> Found:
    """It does not say which node it is for."""
    section = text.section(_SECTION)
    if text.is_dcf and "nodeid" not in text.values(_SECTION):
        yield section.line if section else 1, "no NodeID in [DeviceComissioning]: for which node it is, is not said"


@check("commissioning-spelling", NOTE, "DeviceCommissioning with two m, where the standard has one",
       f"{_SOURCE}: DeviceComissioning")  # fmt: skip
def commissioning_spelling(text: LintedText) -> Found:
    """Most tools look for the standard's spelling and miss the node-ID."""
    section = text.section(_SECTION)
    if section is not None and section.name.lower() != _SECTION:
        yield section.line, f"[{section.name}] is spelled [DeviceComissioning] in the standard: most tools miss it"


@check("commissioned-bit-rate", WARNING, "Baudrate is none of CiA 301's (kbit/s), or one that DeviceInfo says 0 to",
       f"{_SOURCE}: Baudrate")  # fmt: skip
def commissioned_bit_rate(text: LintedText) -> Found:
    """The node would not be heard."""
    value = given(text.values(_SECTION), "baudrate")
    if value is None:
        return
    try:
        rate = read_number(without_comment(value.value))
    except ValueError:
        rate = -1
    supported = text.file.dictionary.info.bit_rates_kbit
    if rate == 0:  # not set
        return
    if rate not in _RATES:
        rates = ", ".join(map(str, _RATES))
        yield value.line, f"{quoted(value)} is no bit rate; those are {rates} kbit/s"
    elif supported and rate not in supported:
        yield value.line, f"{quoted(value)}, but BaudRate_{rate} is not 1"
