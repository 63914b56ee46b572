"""The API's tests use the fixtures that it offers."""

from dvtcli.testing import (
    dvtcli_bus,
    dvtcli_node,
    dvtcli_nodes,
    dvtcli_serve,
    dvtcli_simulate,
    dvtcli_state,
)

__all__ = ["dvtcli_bus", "dvtcli_node", "dvtcli_nodes", "dvtcli_serve", "dvtcli_simulate", "dvtcli_state"]
