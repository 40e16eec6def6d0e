"""novel_view."""
