"""The parts of full screens: fields, lists, questions, panes, and operations that run beside a screen."""
