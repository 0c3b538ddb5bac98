"""Motions that are written as they go, so that they can be read and gone on with."""
