"""The ``hsslam`` command: thin; every verb is a few lines over the library.

Nothing here imports numba, pydantic, gtsam, scipy or matplotlib until a verb needs it: help is instant.
"""
