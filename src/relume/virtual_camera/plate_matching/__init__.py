"""How a plate's camera draws: sharpness, grain, vignetting, measured and given to what is rendered."""
