"""Sphinx extensions of the book: what the build makes of the chapters."""
