"""Rules about PDOMapping: what a file lets PDOs carry that they cannot, and what it does not say."""

from __future__ import annotations

from dvtcli.domain.lint.described import OF_MANY, DescribedDevice, Found, Spot, at
from dvtcli.domain.lint.lint_rule import NOTE, WARNING, check
from dvtcli.domain.mapping import MAX_PDO_BITS
from dvtcli.domain.object_dictionary import Access

_SOURCE = "CiA 306, 4.6.3: PDOMapping"
#: Store, restore, and the parameters of SDOs and PDOs.
_PARAMETERS = ((0x1010, 0x1011), (0x1200, 0x1BFF))


@check("mappability-unknown", WARNING, "the file has PDOs and no PDOMapping: what they may carry is not known", _SOURCE)
def mappability_unknown(device: DescribedDevice) -> Found:
    """Tools offer everything, or nothing."""
    if device.pdos and not device.dictionary.tells_mappability:
        yield Spot(), "no object has PDOMapping: what a PDO may carry is not known"


@check("unmappable-type", WARNING, "PDOMapping=1 on what fits no PDO: of varying length, or more than 64 bits",
       "CiA 301, 7.5.2.36")  # fmt: skip
def unmappable_type(device: DescribedDevice) -> Found:
    """A mapping entry has a length of 1 to 64 bits."""
    for entry in device.entries:
        if entry.pdo_mapping and entry.data_type is not None and not 1 <= (entry.bits or 0) <= MAX_PDO_BITS:
            yield at(entry, "pdomapping"), f"PDOMapping=1, but a PDO cannot carry a {entry.data_type.name}"


@check("mappable-parameter", WARNING, "PDOMapping=1 on a parameter of SDOs or PDOs, or on store or restore",
       "CiA 301, 7.5.2")  # fmt: skip
def mappable_parameter(device: DescribedDevice) -> Found:
    """A PDO that changes PDOs."""
    for entry in device.entries:
        if entry.pdo_mapping and any(first <= entry.index <= last for first, last in _PARAMETERS):
            yield at(entry, "pdomapping"), "PDOMapping=1 on a communication parameter"


@check("mappable-count", NOTE, "PDOMapping=1 on a sub-index 0 that counts", "CiA 301, 7.4.3")
def mappable_count(device: DescribedDevice) -> Found:
    """Hardly meant."""
    for found in device.objects:
        first = found.entries.get(0)
        if found.object_type in OF_MANY and len(found.entries) > 1 and first is not None and first.pdo_mapping:
            yield at(first, "pdomapping"), "PDOMapping=1 on the number of sub-indices"


@check("mappable-constant", NOTE, "PDOMapping=1 on what never changes (const)", _SOURCE)
def mappable_constant(device: DescribedDevice) -> Found:
    """It would take room in every frame."""
    for entry in device.entries:
        if entry.pdo_mapping and entry.access is Access.CONST:
            yield at(entry, "pdomapping"), "PDOMapping=1, and the object is const"


@check("process-access", NOTE, "AccessType rwr or rww, which are about PDOs, on what no PDO may carry",
       "CiA 306, 4.6.3: AccessType")  # fmt: skip
def process_access(device: DescribedDevice) -> Found:
    """One of AccessType and PDOMapping is wrong."""
    for entry in device.entries:
        if entry.access in (Access.RWR, Access.RWW) and entry.pdo_mapping is False:
            yield at(entry, "accesstype"), f"AccessType={entry.access}, but PDOMapping=0"


@check("bits-below-granularity", NOTE, "PDOMapping=1 on an object whose length is no multiple of Granularity",
       "CiA 306, DeviceInfo: Granularity")  # fmt: skip
def bits_below_granularity(device: DescribedDevice) -> Found:
    """`map` refuses it."""
    if device.dictionary.info.granularity != 8:
        return
    for entry in device.entries:
        if entry.pdo_mapping and entry.bits and entry.bits % 8:
            yield at(entry, "pdomapping"), f"PDOMapping=1 with {entry.bits} bits, but Granularity=8"
