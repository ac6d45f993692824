"""The filter of several modes for batches of hundreds of tracks, compiled where numba is installed. Enter by `tracks`."""
