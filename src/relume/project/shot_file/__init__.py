"""The shot file of `relume insert`, a module a table."""
