"""Runs the same pairs through twoview, COLMAP, OpenGV, OpenCV and PoseLib: docs/compare.md."""
