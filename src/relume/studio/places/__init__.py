"""The page of a place file: `relume studio place.toml`."""
