"""SLAM: a front end that tracks every scan, a loop closer, and a GTSAM pose graph behind both."""
