"""The impure part: links, clocks, threads, files; everything that the picture must not know."""
