"""Occupancy grids from scans and poses: building, writing, drawing and measuring them."""
