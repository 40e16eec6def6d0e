"""The film file of `relume film`: a scene's sequence rendered, developed with one exposure and joined to a movie."""
