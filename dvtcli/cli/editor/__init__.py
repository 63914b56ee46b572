"""The mapping editor: a node's PDOs on a full screen."""
