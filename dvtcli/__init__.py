"""dvtcli: a PDO configurator for CANopen devices."""

from dvtcli.version import __version__ as __version__
