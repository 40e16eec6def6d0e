"""Lamps and shots as Mitsuba 3 scenes."""
