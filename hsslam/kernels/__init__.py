"""Numba kernels on plain arrays: surface and raster of a reference, fitness and covariance of a pose."""
