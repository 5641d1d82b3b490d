"""Matchers that come with hsslam."""
