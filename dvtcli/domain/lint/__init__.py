"""Rules of `eds check` over an object dictionary.

Kept empty of imports: the file's reader imports `lint_rule` from here, and nothing else before a file is checked.
"""
