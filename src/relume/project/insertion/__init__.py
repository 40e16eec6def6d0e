"""The chain of `relume insert`, as frozen results."""
