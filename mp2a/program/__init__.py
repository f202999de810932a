"""A method's rounds as a program: written once as the paper writes them, run on arrays, or recorded and replayed.

A method is plain Python over its rounds. With arrays of all nodes it runs as it stands (`mp2a.program.local`). For one
rank it is run once with symbols in the place of arrays (`mp2a.program.recorder`); what is noted down is replayed step
by step over any transport (`mp2a.program.replay`), or by compiled calls with persistent requests
(`mp2a.program.compiled`).
"""
