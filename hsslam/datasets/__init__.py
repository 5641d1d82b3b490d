"""Logs to work on: real ones, simulated ones, files of the user's."""
