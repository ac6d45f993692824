"""What all tests share."""

from hypothesis import settings

# How long an example takes is the machine's affair: nothing here fails for the time that it takes.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")
