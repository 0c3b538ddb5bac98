"""Motions on disk: states and checkpoints are written during the run, so that it can be read and continued."""
