"""What a client orders for itself: its net, its default node, its time-out, what it is told. Reaches no node."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.gateway.error_numbers import GatewayError
from dvtcli.domain.gateway.gateway_answers import Answer, Done, Failed
from dvtcli.version import __version__

if TYPE_CHECKING:
    from dvtcli.operations.gateway.line_client import LineClient

#: the only net that there is
NET = 1
#: how long an SDO of a client may take, since all clients wait meanwhile (ms)
_MOST_SDO_MS = 5000
_HELP = "r w start stop preop reset set info lss_... (CiA 309-3)"


def ordered(client: LineClient, name: str, numbers: tuple[int, ...]) -> Answer:
    """Do what the order *name* sets for its *client*, or says."""
    match name, numbers:
        case "set network", (net,):
            if net != NET:
                return Failed(GatewayError.UNSUPPORTED_NET)
            client.net = net
        case "set node", (node_id,):
            if not 1 <= node_id <= 127:
                return Failed(GatewayError.UNSUPPORTED_NODE)
            client.node = node_id
        case "set sdo_timeout", (milliseconds,):
            return _set_sdo_time_out(client, milliseconds)
        case "set command_timeout", _:
            pass  # an answer always comes, within the time of its SDOs
        case "boot_up_indication enable" | "boot_up_indication disable", _:
            client.told_boot_ups = name.endswith("enable")
        case "info version", _:
            return Done(f"dvtcli {__version__} CiA 309-3")
        case "help" | "help datatype" | "help lss", _:
            return Done(_HELP)
        case _:
            return Failed(GatewayError.NOT_SUPPORTED)
    return Done()


def _set_sdo_time_out(client: LineClient, milliseconds: int) -> Answer:
    if milliseconds > _MOST_SDO_MS:
        return Failed(GatewayError.SYNTAX, f"at most {_MOST_SDO_MS} ms: all clients wait meanwhile")
    client.timeout_s = milliseconds / 1000
    return Done()
