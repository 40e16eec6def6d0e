"""The reflectance of a patch of skin: measured in one plane, separated, fitted, and beside a model of its layers."""
