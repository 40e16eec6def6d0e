"""Commands that make pictures of scenes: render, film, and the reflection maps for others' renderers."""
