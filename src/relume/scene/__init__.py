"""A description of what is rendered; no renderer, no pixels."""
