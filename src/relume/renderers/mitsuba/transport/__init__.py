"""Light transport of differential rendering, in Dr.Jit; only what renders imports it, for it imports Mitsuba."""
