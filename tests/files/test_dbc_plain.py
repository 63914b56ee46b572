"""Plain messages of a DBC file, read without cantools, are those that cantools reads; the rest is left to it whole."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cantools.database
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dvtcli.domain.ports import Frame
from dvtcli.files.dbc import read_dbc
from dvtcli.files.dbc_child import _message, in_order, without_plain
from dvtcli.watch.decoder import Decoder

#: what Vector's editor writes at the beginning of each file: the keywords that it may have
HEAD = (
    'VERSION ""\n\n\nNS_ : \n\tNS_DESC_\n\tCM_\n\tBA_DEF_\n\tBA_\n\tVAL_\n\tCAT_DEF_\n\tCAT_\n\tFILTER\n\tBA_DEF_DEF_\n'
    "\tEV_DATA_\n\tENVVAR_DATA_\n\tSGTYPE_\n\tSGTYPE_VAL_\n\tBA_DEF_SGTYPE_\n\tBA_SGTYPE_\n\tSIG_TYPE_REF_\n"
    "\tVAL_TABLE_\n\tSIG_GROUP_\n\tSIG_VALTYPE_\n\tSIGTYPE_VALTYPE_\n\tBO_TX_BU_\n\tBA_DEF_REL_\n\tBA_REL_\n"
    "\tBA_DEF_DEF_REL_\n\tBU_SG_REL_\n\tBU_EV_REL_\n\tBU_BO_REL_\n\tSG_MUL_VAL_\n\nBS_:\n\nBU_: A B\n"
)
_NAMES = st.sampled_from(["S", "T", "U_", "V1", "VAL_", "FILTER"])
_NUMBERS = st.sampled_from([1, 1, 2, 3, 0x7FF, 0x800, 0x8000_0001, 0xDFFF_FFFF])
_SIGNALS = st.builds(
    ' SG_ {} {}: {}|{}@{}{} ({},{}) [{}|{}] "{}" {}\n'.format,
    _NAMES, st.sampled_from(["", "", "", "M ", "m0 ", "m1 ", "m0M "]), st.integers(0, 64),
    st.sampled_from([0, 1, 3, 8, 8, 16]),
    st.sampled_from("0111"), st.sampled_from("+-"), st.sampled_from(["1", "0.5", "-2", "1e2", "2.0", "007"]),
    st.sampled_from(["0", "-40", "0.0"]), st.just("0"), st.sampled_from(["0", "1.5"]),
    st.sampled_from(["", "V", "BO_ 1 X: 8 A", "\\n", '\\"', "°C"]),
    st.sampled_from(["A", "A,B", "A , B", "Vector__XXX", "A\n,B"]),
)  # fmt: skip
_MESSAGES = st.builds(
    "BO_ {} {}: {} {}\n{}\n".format,
    _NUMBERS, _NAMES | st.just("VECTOR__INDEPENDENT_SIG_MSG"), st.sampled_from([0, 3, 8, 8, 64]),
    st.sampled_from(["A", "Vector__XXX"]), st.lists(_SIGNALS, max_size=3).map("".join),
)  # fmt: skip
_SAID = st.builds(
    str.format,
    st.sampled_from([
        "SIG_VALTYPE_ {0} {1} : 1;\n", "SIG_VALTYPE_ // of\n {0} {1} : 2;\n", "SG_MUL_VAL_ {0} {1} S 0-1;\n",
        'CM_ SG_ {0} S "x;\nBO_ 5 Y: 8 A\n";\n', 'CM_ BO_ {0} "CM_";\n', 'CM_ "a" ;\n', 'CM_ BU_ A "";\n',
        'BA_DEF_ BO_ "K" INT 0 9;\nBA_DEF_DEF_ "K" 0;\nBA_ "K" BO_ {0} 5;\n', "BO_TX_BU_ {0} : A,B;\n",
        'BA_DEF_ SG_ "SystemSignalLongSymbol" STRING ;\nBA_ "SystemSignalLongSymbol" SG_ {0} {1} "Long{1}";\n',
        'BA_DEF_ BO_ "SystemMessageLongSymbol" STRING ;\nBA_ "SystemMessageLongSymbol" BO_ {0} "Long";\n',
        'VAL_TABLE_ T 1 "a" 0 "b;" ;\n', "// CM_ BO_ 1 X: 8 A\n", "\n", "// \"\n", "SIG_GROUP_ {0} G 1 : {1};\n",
    ]),
    _NUMBERS, _NAMES,
)  # fmt: skip
TEXTS = st.lists(_MESSAGES | _MESSAGES | _SAID, max_size=6).map(lambda parts: HEAD + "".join(parts))


def read_by_cantools(text: str) -> list[dict[str, Any]]:
    return [_message(message) for message in cantools.database.load_string(text, "dbc").messages]


def by_id(messages: list[dict[str, Any]]) -> dict[tuple[int, bool], dict[str, Any]]:
    """The last message of each CAN-ID, as the decoder takes it."""
    return {(message["id"], message["extended"]): message for message in messages}


@pytest.mark.hypothesis
@given(TEXTS)
@example(HEAD + 'BO_ 1 S: 8 A\n SG_ T : 0|8@1+ (1,0) [0|0] "" A\n\nCM_ "x";\nBO_ 2 S: 8 A\n\nBO_ 1 T: 8 A\n')
@example(HEAD + 'BO_ 1 S: 8 A\n SG_ T : 0|8@1+ (1,0) [0|0] "" A\n SG_ T M : 8|8@1+ (1,0) [0|0] "" A\n\n')
def test_what_is_read_is_what_cantools_reads(text: str) -> None:
    plain, rest = without_plain(text)
    assert rest.count("\n") == text.count("\n")
    try:
        whole = read_by_cantools(text)
    except Exception as wrong:  # noqa: BLE001 - cantools raises what it comes across
        with pytest.raises(type(wrong)):
            read_by_cantools(rest)
        return
    ours = in_order(text, [*plain, *read_by_cantools(rest)])
    assert list(by_id(ours).items()) == list(by_id(whole).items())


def test_the_usual_is_not_left_to_cantools() -> None:
    """Messages of the usual form, comments, names of values and attributes: what large files consist of."""
    text = HEAD + "".join(
        f'BO_ {0x8000_0000 + number} M{number}: 8 A\n SG_ Speed : 7|16@0- (0.1,-40) [-40|210.5] "km/h" A,B\n'
        f' SG_ Counter : 16|4@1+ (1,0) [0|0] "" Vector__XXX\n\nCM_ SG_ {0x8000_0000 + number} Speed "some; words\n";\n'
        f'BA_ "GenSigStartValue" SG_ {0x8000_0000 + number} Speed -1.5;\n'
        f'VAL_ {0x8000_0000 + number} Counter 0 "a" 1 "b" ;\n'
        for number in range(20)
    )
    plain, rest = without_plain(text)
    assert len(plain) == 20
    assert rest.split() == HEAD.split()


@pytest.mark.parametrize("more", ['CM_ BO_ 1 "x";\n', 'VAL_ 1 S 1 "x";\n', 'VAL_TABLE_ S 1 "x";\n', ""])
def test_the_list_of_keywords_at_the_beginning_hides_no_message(tmp_path: Path, more: str) -> None:
    first, second = (f'BO_ {n} M{n}: 1 A\n SG_ S : 0|8@1+ ({n},0) [0|0] "" A\n\n' for n in (1, 2))
    text = HEAD + first + more + second
    (tmp_path / "m.dbc").write_text(text)
    decoder = Decoder(read_dbc(str(tmp_path / "m.dbc")))
    assert decoder.values(Frame(1, b"\x05")) == {"S": 5}
    assert decoder.values(Frame(2, b"\x05")) == {"S": 10}


@pytest.mark.parametrize("rest", ["", "\n", "// a comment\n"])
def test_a_file_that_has_messages_only_is_read(tmp_path: Path, rest: str) -> None:
    (tmp_path / "m.dbc").write_text(f'BO_ 1 M: 1 A\n SG_ S : 0|8@1+ (1,0) [0|0] "" A\n{rest}')
    assert Decoder(read_dbc(str(tmp_path / "m.dbc"))).values(Frame(1, b"\x05")) == {"S": 5}
