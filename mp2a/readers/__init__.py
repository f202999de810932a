"""Where models come from. Each module returns the fields of `mp2a.model.Model` as a dictionary."""
