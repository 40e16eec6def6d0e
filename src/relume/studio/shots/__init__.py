"""The studio: a shot file and its photographs, edited and rendered in the browser."""
