"""What is odd about a described device: rules over an object dictionary, as `eds check` asks them.

Kept empty of imports: the file's reader takes `lint_rule` from here, and nothing else before a file is checked.
"""
