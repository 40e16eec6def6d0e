"""glTF files: document, materials, textures, cameras, animation, writing."""
