"""The commands that open a page in the browser."""
