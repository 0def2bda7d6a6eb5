"""Reproduces the paper's figures and tables from real data: docs/paper.md."""
