"""Builds the site of docs/ and checks its pages: scripts/docs and test/docs."""
