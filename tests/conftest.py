"""What all tests share."""

from hypothesis import settings

# A busy machine is no failure. The rest stays as Hypothesis chose it: its own profile where the variable CI is set.
settings.register_profile("tral", settings(), deadline=None)
settings.load_profile("tral")
