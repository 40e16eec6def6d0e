"""pattanaik."""
