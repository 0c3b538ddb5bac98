"""Charts and pictures of strings in wells."""
