"""Programs: tapes scheduled, vectorized and encoded for the core's evaluator."""
