"""Systems from equations: the only part of the engine that knows symbols."""
