"""The scene file of `relume render`."""
