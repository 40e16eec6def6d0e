"""Path tracing by Mitsuba 3: scenes, materials, differential rendering, denoising."""
