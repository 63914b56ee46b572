"""The rules that the reader of XDD and XDC files checks while reading, beside those shared with an EDS."""

from __future__ import annotations

from dvtcli.domain.lint.lint_rule import ERROR, NOTE, WARNING, LintRule

_OBJECTS = "CiA 311, CANopenObject"

NO_PARAMETER = LintRule("no-parameter", WARNING, "uniqueIDRef names no parameter of the file", "CiA 311, uniqueIDRef")
PARAMETER_TWICE = LintRule("parameter-twice", WARNING, "two parameters have one uniqueID", "CiA 311, uniqueIDRef")
MAPPING_WORD = LintRule("mapping-word", WARNING, "PDOmapping is not one of no, default, optional, TPDO, RPDO", _OBJECTS)
MAPPING_DIRECTION = LintRule("mapping-direction", WARNING, "PDOmapping is a direction that the access type forbids",
                             f"{_OBJECTS}; CiA 301, 7.4.6")  # fmt: skip
OBJECT_TWICE = LintRule("object-twice", WARNING, "an object, or a sub-index of it, is described twice", _OBJECTS)
NO_INDEX = LintRule("no-index", ERROR, "an object, or a sub-index of it, has no number: it is left out", _OBJECTS)
OBJECT_LISTS = LintRule("object-lists", WARNING, "there are several lists of objects: the first is used",
                        "CiA 311, CANopenObjectList")  # fmt: skip
OTHER_NAMESPACE = LintRule("other-namespace", NOTE, "the file is in none of the published namespaces of CiA 311",
                           "CiA 311, 1.0 and 1.1")  # fmt: skip
COMMISSIONING = LintRule("commissioned", NOTE, "a value of deviceCommissioning is none; it is left out",
                         "CiA 311, deviceCommissioning")  # fmt: skip

#: All rules of this file.
XDD_RULES = tuple(value for value in tuple(globals().values()) if isinstance(value, LintRule))
