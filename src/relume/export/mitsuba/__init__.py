"""mitsuba."""
