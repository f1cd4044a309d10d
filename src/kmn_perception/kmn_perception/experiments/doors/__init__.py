"""The experiment on labelled frames of doors in their walls; `evaluate_doors` is its program."""
