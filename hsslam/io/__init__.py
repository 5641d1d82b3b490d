"""Readers and writers of the files that hsslam shares with other tools."""
