"""Numba kernels on plain arrays: surfaces and rasters of a reference, fitness of a pose, covariance of a match."""
