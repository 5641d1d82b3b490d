"""Comparing matchers honestly: trials, metrics, reports."""
