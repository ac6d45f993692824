"""Routes under threat (paper 002-3)."""
