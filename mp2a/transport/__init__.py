"""How an exchange happens. The only place that waits."""
