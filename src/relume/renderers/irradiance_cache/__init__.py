"""The irradiance cache (Ward, Rubinstein & Clear 1988; Ward & Heckbert 1992)."""
