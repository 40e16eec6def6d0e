"""Spectra: light and reflectance as functions of wavelength, and the linear Rec. 709 colours that they have."""
