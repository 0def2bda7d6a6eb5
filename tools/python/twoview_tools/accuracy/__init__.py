"""Pose accuracy of twoview and of its peers on the data sets: docs/accuracy.md."""
