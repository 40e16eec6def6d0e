"""The photographs of a shot merged into radiance: brackets of one camera together, a single plate by itself."""
