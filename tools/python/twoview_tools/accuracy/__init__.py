"""Measures the pose accuracy of twoview and its peers on the data sets: docs/accuracy.md."""
