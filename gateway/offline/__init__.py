"""Works on what was archived or recorded; takes and returns values."""
