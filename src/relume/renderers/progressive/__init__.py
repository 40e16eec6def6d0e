"""Renders as sums of passes: noise target, checkpoints, Ctrl-C and resuming."""
