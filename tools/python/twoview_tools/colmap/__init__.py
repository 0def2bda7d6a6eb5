"""COLMAP databases and models, in and out: `twoview colmap` (docs/colmap.md)."""
