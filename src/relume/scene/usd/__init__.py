"""USD files: meshes, materials and the stage that they stand on, by OpenUSD."""
