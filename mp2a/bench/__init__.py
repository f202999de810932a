"""The benchmark: what each rank runs, who starts the ranks, and what is kept of it."""
