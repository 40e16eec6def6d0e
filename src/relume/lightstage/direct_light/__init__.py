"""Direct light on a subject's mesh, fitted to its reflectance functions (a control variate for relighting)."""
