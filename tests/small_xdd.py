"""XDD files as text, made in a few words for a test."""

from __future__ import annotations

NAMESPACE = "http://www.canopen.org/xml/1.1"
_HEAD = """<?xml version="1.0" encoding="utf-8"?>
<ISO15745ProfileContainer xmlns="{namespace}" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance">
 <ISO15745Profile>
  <ProfileBody xsi:type="ProfileBody_Device_CANopen" xmlns="">
   <DeviceIdentity><vendorName>{vendor}</vendorName><vendorID>0x286</vendorID><productName>Pump</productName>
    <productID>0x457</productID></DeviceIdentity>
   <ApplicationProcess><parameterList>{parameters}</parameterList></ApplicationProcess>
  </ProfileBody>
 </ISO15745Profile>
 <ISO15745Profile>
  <ProfileBody xsi:type="ProfileBody_CommunicationNetwork_CANopen" xmlns="">
   <ApplicationLayers><CANopenObjectList>
"""
_TAIL = """   </CANopenObjectList>
   <dummyUsage><dummy entry="Dummy0005=1"/><dummy entry="Dummy0006=0"/></dummyUsage></ApplicationLayers>
   <TransportLayers><PhysicalLayer><baudRate>
    <supportedBaudRate value="500 Kbps"/><supportedBaudRate value="auto-baudRate"/>
   </baudRate></PhysicalLayer></TransportLayers>
   <NetworkManagement><CANopenGeneralFeatures granularity="8" nrOfRxPDO="1" nrOfTxPDO="1" bootUpSlave="true"
     layerSettingServiceSlave="true"/>{commissioning}</NetworkManagement>
  </ProfileBody>
 </ISO15745Profile>
</ISO15745ProfileContainer>
"""
_RECORD = """    <CANopenObject index="{index:04X}" name="{name}" objectType="9"
     subNumber="{count}">{subs}</CANopenObject>
"""


def attributes(**given: object) -> str:
    """XML attributes; the names are the standard's."""
    return " ".join(f'{name}="{value}"' for name, value in given.items())


def variable(index: int, name: str, data_type: str = "0007", access: str = "ro", **more: object) -> str:
    """A variable with all that it says in its own attributes."""
    said = attributes(dataType=data_type, accessType=access, **more)
    return f'    <CANopenObject index="{index:04X}" name="{name}" objectType="7" {said}/>\n'


def record(index: int, name: str, *subs: tuple[int, str, str, object]) -> str:
    """A record: of each sub-index its number, data type, access type and default."""
    each = "".join(
        f'\n     <CANopenSubObject subIndex="{sub:02X}" name="part {sub}" objectType="7" dataType="{kind}"'
        f' accessType="{access}" PDOmapping="no" defaultValue="{default}"/>'
        for sub, kind, access, default in subs
    )
    return _RECORD.format(index=index, name=name, count=len(subs), subs=each)


#: What makes a device that can be simulated: identity, an RPDO and a TPDO, and objects to map.
OBJECTS = (
    variable(0x1000, "Device type", PDOmapping="no", defaultValue="0x191")
    + variable(0x1001, "Error register", "0005", PDOmapping="TPDO")
    + record(0x1018, "Identity", (0, "0005", "ro", 2), (1, "0007", "ro", "0x286"), (2, "0007", "ro", "0x457"))
    + record(0x1400, "RPDO 1", (0, "0005", "ro", 2), (1, "0007", "rw", "$NODEID+0x200"), (2, "0005", "rw", 255))
    + record(0x1600, "RPDO 1 mapping", (0, "0005", "rw", 1), (1, "0007", "rw", "0x62000008"))
    + record(0x1800, "TPDO 1", (0, "0005", "ro", 2), (1, "0007", "rw", "$NODEID+0x180"), (2, "0005", "rw", 255))
    + record(0x1A00, "TPDO 1 mapping", (0, "0005", "rw", 1), (1, "0007", "rw", "0x60000008"))
    + variable(0x6000, "Input", "0005", PDOmapping="default")
    + variable(0x6200, "Output", "0005", "rw", PDOmapping="RPDO", actualValue="0x11", denotation="main valve")
)
COMMISSIONING = (
    '<deviceCommissioning nodeID="7" nodeName="Pump 7" actualBaudRate="500 Kbps" networkNumber="2" '
    'networkName="Hall" CANopenManager="false"/>'
)


def xdd(
    objects: str = OBJECTS,
    parameters: str = "",
    namespace: str = NAMESPACE,
    commissioning: str = "",
    vendor: str = "Vendor",
) -> str:
    """A whole file."""
    head = _HEAD.format(namespace=namespace, parameters=parameters, vendor=vendor)
    return head + objects + _TAIL.format(commissioning=commissioning)
