"""Jobs for render farms, as Open Job Description (OpenJD) describes them."""
