"""Turning real spherical harmonics: a rotation mixes the orders of a degree and nothing else."""

from __future__ import annotations

import numpy as np


def rotated(coefficients: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Coefficients ((L + 1)², C) of the function turned by an active rotation (3, 3)."""
    from relume.sphere.spherical_harmonics import _blocks
    degree = round(len(coefficients) ** 0.5) - 1
    n, w = np.polynomial.legendre.leggauss(degree + 1)
    phi = 2*np.pi*np.arange(2*degree+1)/(2*degree+1)
    ring = np.sqrt(1-n*n)
    d = np.stack([ring[:,None]*np.cos(phi), ring[:,None]*np.sin(phi), np.broadcast_to(n[:,None],(len(n),len(phi)))],-1).reshape(-1,3)
    weights = np.repeat(w, len(phi))*2*np.pi/len(phi)
    out = np.zeros_like(coefficients)
    i=0
    for a, b in zip(_blocks(d, degree), _blocks(d @ rotation, degree)):
        n_=a.shape[1]
        out += a @ (weights[i:i+n_,None]*(b.T @ coefficients)); i+=n_
    return out
