"""Deghosting: what moved while a bracket was taken is merged from one instant only."""
