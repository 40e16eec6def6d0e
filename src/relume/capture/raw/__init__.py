"""Camera raws: merged photosite by photosite with their noise, then demosaiced."""
