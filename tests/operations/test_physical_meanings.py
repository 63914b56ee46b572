"""Which meaning an object's value has where nobody says of which type it is."""

from __future__ import annotations

from dvtcli.files.eds.reader import read_eds
from dvtcli.files.profiles import load_profile
from dvtcli.operations.values.object_values import scalings_of
from dvtcli.simulator.network.family_file import family_eds


def test_an_object_that_no_file_describes_has_no_unit() -> None:
    """Without its type -1500 rpm would be 4294965796 rpm, and -7.5 A would be 4088.5 A."""
    gen4 = load_profile("gen4")
    described, bare = scalings_of(gen4, read_eds(family_eds("gen4")).dictionary), scalings_of(gen4, None)
    assert (described.of(0x606C, 0).unit, described.of(0x5100, 2).unit) == ("rpm", "A")
    for place in ((0x606C, 0), (0x5100, 2), (0x60FF, 0)):
        assert not bare.of(*place).has_number
    assert bare.of(0x1017, 0).unit == "ms", "CiA 301 says of which type that is"
    assert bare.of(0x6041, 0).bits, "bits have names, whatever the type"
