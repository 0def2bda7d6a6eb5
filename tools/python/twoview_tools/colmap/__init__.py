"""Imports from and exports to COLMAP databases and models: `twoview colmap` (docs/colmap.md)."""
