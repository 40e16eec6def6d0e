"""From photographs under one light at a time to a calibrated store: stage files, lights, calibration."""
