"""Many independent cases of one task, computed on all ranks."""
