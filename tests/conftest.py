"""Settings of every test."""

from hypothesis import HealthCheck, settings

settings.register_profile(
    "mp2a",
    deadline=None,
    max_examples=50,
    derandomize=True,  # a run tells the same as the last one
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("mp2a")
