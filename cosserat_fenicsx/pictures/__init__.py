"""Pictures, charts and films of results."""
