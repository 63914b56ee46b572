"""dvtcli: a PDO configurator for CANopen devices."""

__version__ = "0.1.0"
