"""What a lens and its shutter do to light on its way to the sensor."""
