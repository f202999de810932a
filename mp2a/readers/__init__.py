"""Where chains come from. Each module returns the fields of `mp2a.chain.Chain` as a dictionary."""
