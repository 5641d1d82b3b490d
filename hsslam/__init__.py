"""hsslam: 2D laser scan matchers that compete on equal terms and feed one pose graph.

Importing the package is cheap; the parts are imported from their own modules.
"""

from hsslam.version import __version__

__all__ = ["__version__"]
